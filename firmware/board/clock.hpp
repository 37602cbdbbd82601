#pragma once
#include <avr/io.h>

/// Timer 0: millisecond and motor tone.
///
/// While beeping, the timer runs at four times the rate. Compare A starts a pulse in the other direction
/// every 248 us (a tone of 2 kHz). Compare B ends the pulse 48 us later.
namespace clock {

constexpr uint16_t kPrescaler = 64;
constexpr uint32_t kCount_Hz = F_CPU / kPrescaler;
constexpr uint8_t kMillisecond = kCount_Hz / 1000 - 1;
static_assert(kCount_Hz % 1000 == 0 && kCount_Hz / 1000 <= 256, "a millisecond must be exact");
constexpr uint8_t kTonesPerMillisecond = 4;
constexpr uint8_t kTone = kCount_Hz / 1000 / kTonesPerMillisecond - 1;
constexpr uint8_t kPulse = kCount_Hz * 48 / 1000000;

inline void Start() {
  TCCR0A = 1 << WGM01;  // clear on compare match
  TCCR0B = 1 << CS01 | 1 << CS00;
  OCR0A = kMillisecond;
  OCR0B = kPulse;
  TIMSK0 = 1 << OCIE0A;
}

}  // namespace clock
