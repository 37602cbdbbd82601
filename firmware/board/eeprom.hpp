#pragma once
#include <avr/io.h>
#include <util/atomic.h>

/// The EEPROM, a byte at a time. A write takes 3.4 ms by itself; nobody waits for it.
class Eeprom {
 public:
  bool Ready() const { return (EECR & 1 << EEPE) == 0; }

  /// Waits for a write under way: at start, after a restart in the midst of one.
  uint8_t Read(uint8_t address) const {
    while (!Ready()) {
    }
    EEAR = address;
    EECR |= 1 << EERE;
    return EEDR;
  }

  /// Begin a write; only while Ready(). A byte that is there already is left alone: cells wear out.
  void Write(uint8_t address, uint8_t byte) {
    if (Read(address) == byte) return;
    EEDR = byte;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {  // at most four cycles may lie between the two
      EECR = 1 << EEMPE;
      EECR |= 1 << EEPE;
    }
  }
};
