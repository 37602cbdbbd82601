#pragma once
#include <avr/io.h>
#include <util/atomic.h>

/// EEPROM access, one byte at a time. A write takes 3.4 ms in hardware; the program does not wait for it.
class Eeprom {
 public:
  bool Ready() const { return (EECR & 1 << EEPE) == 0; }

  /// Waits for a write in progress, which happens only after a restart during a write.
  uint8_t Read(uint8_t address) const {
    while (!Ready()) {
    }
    EEAR = address;
    EECR |= 1 << EERE;
    return EEDR;
  }

  /// Start a write; call only if Ready(). Skips bytes that already match, because cells wear out.
  void Write(uint8_t address, uint8_t byte) {
    if (Read(address) == byte) return;
    EEDR = byte;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {  // at most four cycles between these two writes
      EECR = 1 << EEMPE;
      EECR |= 1 << EEPE;
    }
  }
};
