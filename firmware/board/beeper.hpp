#pragma once
#include <avr/io.h>
#include <util/atomic.h>

#include "board/clock.hpp"
#include "board/motors.hpp"
#include "board/pins.hpp"

/// Uses the motors as a loudspeaker: short pulses, alternating forward and backward, from Timer 0 (see
/// clock.hpp). While it sounds, the PWM pins are plain outputs, so Timer 2 cannot drive the motors.
class Beeper {
 public:
  constexpr explicit Beeper(motors::Drive& drive) : drive_(drive) {}
  bool sounding() const { return sounding_; }

  /// Call with interrupts on. Not inlined: inlining it, or its first line alone, cost 60 bytes.
  __attribute__((noinline)) void Sound(bool on) {
    if (on == sounding_) return;
    ATOMIC_BLOCK(ATOMIC_FORCEON) {
      sounding_ = on;
      End();
      on ? drive_.Disconnect() : drive_.Reconnect();
      OCR0A = on ? clock::kTone : clock::kMillisecond;
      TIMSK0 = on ? 1 << OCIE0A | 1 << OCIE0B : 1 << OCIE0A;
    }
  }

  /// Compare A: start a pulse in the other direction. Return true once per millisecond.
  bool Begin() {
    PIND = motors::kLeftDirection;  // writing 1 toggles
    PINB = motors::kRightDirection;
    PORTD |= pins::kLeftPwm;
    PORTB |= pins::kRightPwm;
    phase_ = static_cast<uint8_t>(phase_ + 1) % clock::kTonesPerMillisecond;
    return phase_ == 0;
  }

  /// Compare B: end the pulse. Always inlined, because an interrupt with a call saves every register.
  __attribute__((always_inline)) void End() {
    PORTD &= static_cast<uint8_t>(~pins::kLeftPwm);
    PORTB &= static_cast<uint8_t>(~pins::kRightPwm);
  }

 private:
  motors::Drive& drive_;
  bool sounding_ = false;
  uint8_t phase_ = 0;
};
