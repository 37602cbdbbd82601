#pragma once
#include <avr/io.h>
#include <util/atomic.h>

#include "board/clock.hpp"
#include "board/motors.hpp"
#include "board/pins.hpp"

/// The motors as a loudspeaker: short pulses, forward and backward in turn, from Timer 0 (see clock.hpp).
/// While it sounds the PWM pins are plain outputs, so Timer 2 cannot drive.
class Beeper {
 public:
  bool sounding() const { return sounding_; }

  /// Interrupts must be on. Not inlined, nor its first line alone: that took 60 bytes.
  __attribute__((noinline)) void Sound(bool on) {
    if (on == sounding_) return;
    ATOMIC_BLOCK(ATOMIC_FORCEON) {
      sounding_ = on;
      End();
      TCCR2A = on ? motors::kPhaseCorrect : motors::kPhaseCorrect | motors::kOutputs;
      TCNT0 = 0;  // or the counter may have passed the new, lower top
      OCR0A = on ? clock::kTone : clock::kMillisecond;
      TIMSK0 = on ? 1 << OCIE0A | 1 << OCIE0B : 1 << OCIE0A;
    }
  }

  /// Compare A: begin a pulse in the other direction. True once a millisecond.
  bool Begin() {
    PIND = motors::kLeftDirection;  // writing 1 toggles
    PINB = motors::kRightDirection;
    PORTD |= pins::kLeftPwm;
    PORTB |= pins::kRightPwm;
    phase_ = static_cast<uint8_t>(phase_ + 1) % clock::kTonesPerMillisecond;
    return phase_ == 0;
  }

  /// Compare B: end the pulse. Always inlined: an interrupt that calls saves every register.
  __attribute__((always_inline)) void End() {
    PORTD &= static_cast<uint8_t>(~pins::kLeftPwm);
    PORTB &= static_cast<uint8_t>(~pins::kRightPwm);
  }

 private:
  bool sounding_ = false;
  uint8_t phase_ = 0;
};
