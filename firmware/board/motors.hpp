#pragma once
#include <avr/io.h>

#include "board/pins.hpp"
#include "core/config.hpp"

/// Both H-bridges on Timer 2, phase-correct PWM. By default at 122.5 Hz, the T'REX's original rate: "good
/// torque, low noise".
namespace motors {

constexpr uint8_t kPhaseCorrect = 1 << WGM20;
constexpr uint8_t kOutputs = 1 << COM2A1 | 1 << COM2B1;
/// The pins that differ between forward and reverse. Toggling them reverses the motor.
constexpr uint8_t kLeftDirection = pins::kLeftForward ^ pins::kLeftReverse;
constexpr uint8_t kRightDirection = pins::kRightForward ^ pins::kRightReverse;

/// Set the PWM frequency: the nearest lower one of 122, 245, 490, 980, 3922 and 31 373 Hz. Call while the
/// motors are off.
inline void SetFrequency(int16_t frequency_Hz) {
  TCCR2B = frequency_Hz >= 31373  ? 1
           : frequency_Hz >= 3922 ? 2
           : frequency_Hz >= 980  ? 3
           : frequency_Hz >= 490  ? 4
           : frequency_Hz >= 245  ? 5
                                  : 6;
}

/// Connect PWM pins, bits of `kOutputs`, to the timer; each stays low until its next pulse. While a pin was
/// disconnected, the timer kept the level that it had, high with the probability of the duty. It would drive
/// the motor at full voltage until the next compare match, up to a period later. So a forced match, `force`
/// of TCCR2B, clears it first; the timer allows that only outside PWM. Call with the tick held or interrupts
/// off.
inline void Connect(uint8_t pins, uint8_t force) {
  const uint8_t outputs = static_cast<uint8_t>((TCCR2A & kOutputs) | pins);
  TCCR2A = outputs;
  TCCR2B |= force;
  TCCR2A = kPhaseCorrect | outputs;
}

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
  SetFrequency(0);
  Connect(kOutputs, 1 << FOC2A | 1 << FOC2B);
}

/// Switch the motors off for good, whatever the timer does: disconnect the pins from it and drive them low.
inline void Halt() {
  TCCR2A = 0;
  PORTD &= static_cast<uint8_t>(~pins::kLeftOutputs);
  PORTB &= static_cast<uint8_t>(~pins::kRightOutputs);
}

/// PWM of both motors. The timer takes a new duty at the top of its period, up to 8.2 ms after the write. If
/// a motor reversed at once, the old duty would kick it in the new direction. So Set() drives its PWM pin low
/// before it changes the direction. AfterMillisecond() reconnects the pin once the new duty is active. Each
/// side rests by itself.
class Drive {
 public:
  /// Switch both off within a PWM period, brakes released. The control tick must know, or it sets its own
  /// PWM.
  void Off() {
    OCR2A = 0;
    OCR2B = 0;
  }

  /// Set which motors turn the other way round. Call while they are off.
  void SetReversed(bool left, bool right) {
    left_inverted_ = left ? pins::kLeftForward : uint8_t(0);
    right_inverted_ = right ? pins::kRightForward : uint8_t(0);
  }

  /// Set PWM in [-255, 255], positive forward. Call from the control tick.
  void Set(int16_t left, int16_t right) {
    if (((PORTD ^ left_inverted_) & pins::kLeftForward) != 0 ? left < 0 : left > 0) {
      TCCR2A &= static_cast<uint8_t>(~(1 << COM2B1));
      PIND = kLeftDirection;  // writing 1 toggles
      left_rest_ = kRest;
    }
    if (((PORTB ^ right_inverted_) & pins::kRightForward) != 0 ? right < 0 : right > 0) {
      TCCR2A &= static_cast<uint8_t>(~(1 << COM2A1));
      PINB = kRightDirection;
      right_rest_ = kRest;
    }
    OCR2B = Duty(left);
    OCR2A = Duty(right);
  }

  /// Write 0 to the PWM of a motor that rests until the next tick, so that telemetry and monitors see what is
  /// driven. Call soon after Set().
  void MarkRests(int16_t* left, int16_t* right) const {
    if (kRestsWholeTick && left_rest_ > kRest / 2) *left = 0;
    if (kRestsWholeTick && right_rest_ > kRest / 2) *right = 0;
  }

  /// Reconnect each pin after its rest. Call each time at least one more millisecond has elapsed, with the
  /// tick held and no tone on.
  void AfterMillisecond() {
    if (left_rest_ != 0 && --left_rest_ == 0) Connect(1 << COM2B1, 1 << FOC2B);
    if (right_rest_ != 0 && --right_rest_ == 0) Connect(1 << COM2A1, 1 << FOC2A);
  }

  /// Give the pins to the beeper.
  void Disconnect() { TCCR2A = kPhaseCorrect; }

  /// Take the pins back, as after a reversal: the tone has toggled the directions. Call with the tick held or
  /// interrupts off.
  void Reconnect() { left_rest_ = right_rest_ = kRest; }

 private:
  /// 8-bit arithmetic: saves two cycles and four bytes.
  static uint8_t Duty(int16_t pwm) {
    uint8_t duty = static_cast<uint8_t>(pwm);
    if (pwm < 0) duty = static_cast<uint8_t>(-duty);
    return duty;
  }

  // Counts calls of AfterMillisecond(), not milliseconds: if the main loop is late, its milliseconds include
  // time before the rest. All of the first call's time, and most of the second's, may lie before it.
  static constexpr uint8_t kRest = 12;
  static_assert((kRest - 3) * (F_CPU / 1000) >= 510 * 256UL, "the rest must last at least one PWM period");

  static constexpr bool kRestsWholeTick = fw::kTick_us <= (kRest - 1) * 1000UL;

  uint8_t left_rest_ = 0, right_rest_ = 0;
  // Inverts the direction pin of a reversed motor.
  uint8_t left_inverted_ = 0, right_inverted_ = 0;
};

}  // namespace motors
