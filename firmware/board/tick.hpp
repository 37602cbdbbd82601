#pragma once
#include <avr/io.h>

#include "core/config.hpp"

/// Timer 1: control tick, compare A in clear-on-compare mode.
namespace tick {

constexpr uint32_t kPrescaler = 256;
constexpr uint32_t kTop = F_CPU / kPrescaler / fw::kControlRate_Hz - 1;
static_assert((kTop + 1) * kPrescaler * fw::kControlRate_Hz == F_CPU, "the control rate must be exact");
static_assert(kTop <= 0xFFFF, "the control rate is too low for Timer 1");
static_assert(fw::kControlRate_Hz != 10 || F_CPU != 16000000UL || kTop == 6249,
              "the timer value of the thesis at 10 Hz");

inline void Start() {
  TCCR1A = 0;  // OC1A and OC1B remain bridge outputs
  OCR1A = kTop;
  TCCR1B = 1 << WGM12 | 1 << CS12;
  TIMSK1 = 1 << OCIE1A;
}

/// Delay the tick until Release(). Encoders and serial port continue.
inline void Hold() {
  TIMSK1 = 0;
  asm volatile("" ::: "memory");
}
inline void Release() {
  asm volatile("" ::: "memory");
  TIMSK1 = 1 << OCIE1A;
}

}  // namespace tick
