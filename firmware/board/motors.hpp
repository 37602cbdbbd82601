#pragma once
#include <avr/io.h>

#include "board/trex.hpp"

/// Both H-bridges on Timer 2, phase-correct at 122.5 Hz, the board's own choice: "good torque, low noise".
namespace motors {

constexpr uint8_t kPhaseCorrect = 1 << WGM20;
constexpr uint8_t kOutputs = 1 << COM2A1 | 1 << COM2B1;

inline void Start() {
  DDRD |= trex::kLeftDirection | trex::kLeftPwm | trex::kLeftBrake;
  DDRB |= trex::kRightDirection | trex::kRightPwm | trex::kRightBrake;
  TCCR2A = kPhaseCorrect | kOutputs;
  TCCR2B = 1 << CS22 | 1 << CS21;  // 16 MHz / 256 / 510
}

/// Both motors off at once, brakes released. Interrupts must be off.
inline void Off() {
  OCR2A = 0;
  OCR2B = 0;
}

/// PWM in [-255, 255], positive forward. Interrupts must be off: the ports hold other pins too.
inline void Set(int16_t left, int16_t right) {
  if (left < 0) {
    PORTD &= static_cast<uint8_t>(~trex::kLeftDirection);
  } else {
    PORTD |= trex::kLeftDirection;
  }
  if (right < 0) {
    PORTB &= static_cast<uint8_t>(~trex::kRightDirection);
  } else {
    PORTB |= trex::kRightDirection;
  }
  OCR2B = static_cast<uint8_t>(left < 0 ? -left : left);
  OCR2A = static_cast<uint8_t>(right < 0 ? -right : right);
}

}  // namespace motors
