#pragma once
#include <avr/interrupt.h>
#include <avr/io.h>

#include "board/pins.hpp"

/// Pin-change interrupts of the encoders: PCINT2 for the left wheel, PCINT0 for the right wheel.
namespace encoders {

inline void Start() {
  DDRD &= static_cast<uint8_t>(~pins::kLeftEncoder);
  DDRB &= static_cast<uint8_t>(~pins::kRightEncoder);
  PORTD |= pins::kLeftEncoder;  // pull-ups: Hall sensors have open collectors
  PORTB |= pins::kRightEncoder;
  PCMSK2 = pins::kLeftEncoder;
  PCMSK0 = pins::kRightEncoder;
  PCICR = 1 << PCIE2 | 1 << PCIE0;
}

}  // namespace encoders
