#pragma once
#include <stdint.h>

// Constant tables in flash. On an AVR, a table without this attribute also takes SRAM.
#ifdef __AVR__
#define FW_IN_FLASH __attribute__((__progmem__))
#else
#define FW_IN_FLASH
#endif

namespace fw {

/// Return a number of a table that has FW_IN_FLASH.
inline int16_t ReadFlash(const int16_t* address) {
#ifdef __AVR__
  int16_t value;
  asm("lpm %A0, Z+ \n\t"
      "lpm %B0, Z"
      : "=&r"(value), "+z"(address));
  return value;
#else
  return *address;
#endif
}

}  // namespace fw
