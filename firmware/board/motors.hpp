#pragma once
#include <avr/io.h>

#include "board/pins.hpp"

/// Both H-bridges on Timer 2, phase-correct at 122.5 Hz, the board's own choice: "good torque, low noise".
namespace motors {

constexpr uint8_t kPhaseCorrect = 1 << WGM20;
constexpr uint8_t kOutputs = 1 << COM2A1 | 1 << COM2B1;
/// The pins that differ between forward and reverse: toggling them turns the motor round.
constexpr uint8_t kLeftDirection = pins::kLeftForward ^ pins::kLeftReverse;
constexpr uint8_t kRightDirection = pins::kRightForward ^ pins::kRightReverse;

/// Start the timer with both motors off, facing forward.
inline void Start() {
  PORTD &= static_cast<uint8_t>(~pins::kLeftOutputs);  // after a restart they may still be high
  PORTB &= static_cast<uint8_t>(~pins::kRightOutputs);
  PORTD |= pins::kLeftForward;
  PORTB |= pins::kRightForward;
  DDRD |= pins::kLeftOutputs;
  DDRB |= pins::kRightOutputs;
  OCR2A = 0;
  OCR2B = 0;
  TCCR2A = kPhaseCorrect | kOutputs;
  TCCR2B = 1 << CS22 | 1 << CS21;  // 16 MHz / 256 / 510
}

/// Off for good, whatever the timer does: the pins leave it and go low.
inline void Halt() {
  TCCR2A = 0;
  PORTD &= static_cast<uint8_t>(~pins::kLeftOutputs);
  PORTB &= static_cast<uint8_t>(~pins::kRightOutputs);
}

/// The PWM of both motors. The timer takes a new duty at the top of its period, up to 8.2 ms after it was
/// written: a motor that is to turn round would be kicked by the old duty in the new direction. So its pin
/// goes low at once, before its direction changes, and the timer gets it back when the new duty has arrived.
class Drive {
 public:
  /// Both off within a PWM period, brakes released. The control tick must know, or it would contradict.
  void Off() {
    OCR2A = 0;
    OCR2B = 0;
  }

  /// PWM in [-255, 255], positive forward. For the control tick.
  void Set(int16_t left, int16_t right) {
    if ((PORTD & pins::kLeftForward) != 0 ? left < 0 : left > 0) {
      TCCR2A &= static_cast<uint8_t>(~(1 << COM2B1));
      PIND = kLeftDirection;  // writing 1 toggles
      rest_ = kRest;
    }
    if ((PORTB & pins::kRightForward) != 0 ? right < 0 : right > 0) {
      TCCR2A &= static_cast<uint8_t>(~(1 << COM2A1));
      PINB = kRightDirection;
      rest_ = kRest;
    }
    OCR2B = Duty(left);
    OCR2A = Duty(right);
  }

  /// Let a millisecond or more pass; the timer takes its pins back. Not while the tick may come, nor a tone.
  void AfterMillisecond() {
    if (rest_ != 0 && --rest_ == 0) TCCR2A = kPhaseCorrect | kOutputs;
  }

 private:
  /// In 8 bits: two cycles and four bytes less.
  static uint8_t Duty(int16_t pwm) {
    uint8_t duty = static_cast<uint8_t>(pwm);
    if (pwm < 0) duty = static_cast<uint8_t>(-duty);
    return duty;
  }

  // Calls of AfterMillisecond(). Not milliseconds: a main loop that is late would count some of before the
  // rest. All of the first one's may be of before, and most of the second one's.
  static constexpr uint8_t kRest = 11;
  static_assert((kRest - 2) * (F_CPU / 1000) >= 510 * 256UL, "a PWM period must pass");

  uint8_t rest_ = 0;
};

}  // namespace motors
