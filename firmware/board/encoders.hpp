#pragma once
#include <avr/interrupt.h>
#include <avr/io.h>

#include "board/trex.hpp"

/// Pin-change interrupts of the encoders: PCINT2 for the left wheel, PCINT0 for the right one.
namespace encoders {

inline void Start() {
  DDRD &= static_cast<uint8_t>(~trex::kLeftEncoder);
  DDRB &= static_cast<uint8_t>(~trex::kRightEncoder);
  PORTD |= trex::kLeftEncoder;  // Hall sensors have open collectors
  PORTB |= trex::kRightEncoder;
  PCMSK2 = trex::kLeftEncoder;
  PCMSK0 = trex::kRightEncoder;
  PCICR = 1 << PCIE2 | 1 << PCIE0;
}

}  // namespace encoders
