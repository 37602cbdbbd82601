#pragma once
#include <avr/io.h>

#include "board/pins.hpp"

/// Both H-bridges on Timer 2, phase-correct PWM at 122.5 Hz, the T'REX's original rate: "good torque, low
/// noise".
namespace motors {

constexpr uint8_t kPhaseCorrect = 1 << WGM20;
constexpr uint8_t kOutputs = 1 << COM2A1 | 1 << COM2B1;
/// The pins that differ between forward and reverse. Toggling them reverses the motor.
constexpr uint8_t kLeftDirection = pins::kLeftForward ^ pins::kLeftReverse;
constexpr uint8_t kRightDirection = pins::kRightForward ^ pins::kRightReverse;

/// Start the timer with both motors off and the direction forward.
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

/// Switch the motors off for good, whatever the timer does: disconnect the pins from it and drive them low.
inline void Halt() {
  TCCR2A = 0;
  PORTD &= static_cast<uint8_t>(~pins::kLeftOutputs);
  PORTB &= static_cast<uint8_t>(~pins::kRightOutputs);
}

/// PWM of both motors. The timer takes a new duty at the top of its period, up to 8.2 ms after the write. If
/// a motor reversed at once, the old duty would kick it in the new direction. So Set() drives its PWM pin low
/// before it changes the direction. AfterMillisecond() reconnects the pin once the new duty is active.
class Drive {
 public:
  /// Switch both off within a PWM period, brakes released. The control tick must know, or it sets its own
  /// PWM.
  void Off() {
    OCR2A = 0;
    OCR2B = 0;
  }

  /// Set PWM in [-255, 255], positive forward. Call from the control tick.
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

  /// Reconnect the pins after the rest. Call each time at least one more millisecond has elapsed, with the
  /// tick held and no tone on.
  void AfterMillisecond() {
    if (rest_ != 0 && --rest_ == 0) TCCR2A = kPhaseCorrect | kOutputs;
  }

 private:
  /// 8-bit arithmetic: saves two cycles and four bytes.
  static uint8_t Duty(int16_t pwm) {
    uint8_t duty = static_cast<uint8_t>(pwm);
    if (pwm < 0) duty = static_cast<uint8_t>(-duty);
    return duty;
  }

  // Counts calls of AfterMillisecond(), not milliseconds: if the main loop is late, its milliseconds include
  // time before the rest. All of the first call's time, and most of the second's, may lie before it.
  static constexpr uint8_t kRest = 11;
  static_assert((kRest - 2) * (F_CPU / 1000) >= 510 * 256UL, "the rest must last at least one PWM period");

  uint8_t rest_ = 0;
};

}  // namespace motors
