#pragma once
#include <avr/io.h>

#include "board/pins.hpp"

/// Both H-bridges on Timer 2, phase-correct at 122.5 Hz, the board's own choice: "good torque, low noise".
namespace motors {

constexpr uint8_t kPhaseCorrect = 1 << WGM20;
constexpr uint8_t kOutputs = 1 << COM2A1 | 1 << COM2B1;
/// The pins that differ between forward and reverse: toggling them turns the motor round.
constexpr uint8_t kLeftWay = pins::kLeftForward ^ pins::kLeftReverse;
constexpr uint8_t kRightWay = pins::kRightForward ^ pins::kRightReverse;

/// Both motors off at once, brakes released.
inline void Off() {
  OCR2A = 0;
  OCR2B = 0;
}

inline void Start() {
  PORTD &= static_cast<uint8_t>(~pins::kLeftOutputs);  // after a restart they may still be high
  PORTB &= static_cast<uint8_t>(~pins::kRightOutputs);
  DDRD |= pins::kLeftOutputs;
  DDRB |= pins::kRightOutputs;
  Off();
  TCCR2A = kPhaseCorrect | kOutputs;
  TCCR2B = 1 << CS22 | 1 << CS21;  // 16 MHz / 256 / 510
}

/// Off for good, whatever the timer does: the pins leave it and go low.
inline void Halt() {
  TCCR2A = 0;
  PORTD &= static_cast<uint8_t>(~pins::kLeftOutputs);
  PORTB &= static_cast<uint8_t>(~pins::kRightOutputs);
}

/// One way off, then the other on: never both at once. Constants, so each is a single instruction.
inline void Turn(volatile uint8_t& port, uint8_t off, uint8_t on) {
  if (off != 0) port &= static_cast<uint8_t>(~off);
  if (on != 0) port |= on;
}

/// PWM in [-255, 255], positive forward. Interrupts must be off: the ports hold other pins too.
inline void Set(int16_t left, int16_t right) {
  if (left < 0) {
    Turn(PORTD, pins::kLeftForward, pins::kLeftReverse);
  } else {
    Turn(PORTD, pins::kLeftReverse, pins::kLeftForward);
  }
  if (right < 0) {
    Turn(PORTB, pins::kRightForward, pins::kRightReverse);
  } else {
    Turn(PORTB, pins::kRightReverse, pins::kRightForward);
  }
  OCR2B = static_cast<uint8_t>(left < 0 ? -left : left);
  OCR2A = static_cast<uint8_t>(right < 0 ? -right : right);
}

}  // namespace motors
