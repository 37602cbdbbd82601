#pragma once
#include <avr/io.h>

#include "core/config.hpp"

/// Timer 1: the control tick, compare A in clear-on-compare mode.
namespace tick {

constexpr uint32_t kPrescaler = 256;
constexpr uint32_t kTop = F_CPU / kPrescaler / fw::kControlRate_Hz - 1;
static_assert((kTop + 1) * kPrescaler * fw::kControlRate_Hz == F_CPU, "the control rate must be exact");
static_assert(kTop <= 0xFFFF, "the control rate is too low for Timer 1");
static_assert(fw::kControlRate_Hz != 10 || F_CPU != 16000000UL || kTop == 6249, "10 Hz as in the thesis");

inline void Start() {
  TCCR1A = 0;  // OC1A and OC1B pins stay with the motor bridge
  OCR1A = kTop;
  TCCR1B = 1 << WGM12 | 1 << CS12;
  TIMSK1 = 1 << OCIE1A;
}

/// Keep the tick off for a moment, it comes afterwards; encoders and serial port go on.
inline void Hold() {
  TIMSK1 = 0;
  asm volatile("" ::: "memory");
}
inline void Release() {
  asm volatile("" ::: "memory");
  TIMSK1 = 1 << OCIE1A;
}

}  // namespace tick
