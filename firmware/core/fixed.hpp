#pragma once
#include <stdint.h>

namespace fw {

/// Return `value` limited to [-limit, limit].
constexpr int32_t Limit(int32_t value, int32_t limit) {
  return value > limit ? limit : value < -limit ? -limit : value;
}

constexpr int32_t Magnitude(int32_t value) { return value < 0 ? -value : value; }

/// Return a * b. gcc calls a 50-cycle routine for a 16 x 16 bit product and spills registers around it. This
/// is the hardware multiplication sequence of application note AVR201, 20 cycles.
__attribute__((always_inline)) inline int32_t Product(int16_t a, int16_t b) {
#ifdef __AVR__
  int32_t product;
  uint8_t zero;
  asm("clr %1 \n\t"
      "muls %B2, %B3 \n\t"
      "movw %C0, r0 \n\t"
      "mul %A2, %A3 \n\t"
      "movw %A0, r0 \n\t"
      "mulsu %B2, %A3 \n\t"
      "sbc %D0, %1 \n\t"
      "add %B0, r0 \n\t"
      "adc %C0, r1 \n\t"
      "adc %D0, %1 \n\t"
      "mulsu %B3, %A2 \n\t"
      "sbc %D0, %1 \n\t"
      "add %B0, r0 \n\t"
      "adc %C0, r1 \n\t"
      "adc %D0, %1 \n\t"
      "clr r1"
      : "=&r"(product), "=&r"(zero)
      : "a"(a), "a"(b));
  return product;
#else
  return int32_t(a) * b;
#endif
}

/// Keep gcc from merging shifts by one. It would make a loop of them, 15 or 21 cycles instead of 6 or 12.
template <typename T>
__attribute__((always_inline)) inline T Separate(T value) {
#ifdef __AVR__
  asm("" : "+r"(value));
#endif
  return value;
}

/// Return value / 8, rounded down.
inline int16_t Eighth(int16_t value) {
  const int16_t quarter = Separate(static_cast<int16_t>(Separate(static_cast<int16_t>(value >> 1)) >> 1));
  return static_cast<int16_t>(quarter >> 1);
}

/// Return 8 * value, which must fit.
inline int32_t EightTimes(int32_t value) { return Separate(Separate(value * 2) * 2) * 2; }

/// Return a - b, limited to +-32767.
__attribute__((always_inline)) inline int16_t Difference(int16_t a, int16_t b) {
  const int16_t wrapped = static_cast<int16_t>(static_cast<uint16_t>(a) - static_cast<uint16_t>(b));
  // Overflow: a and b have different signs, and so do a and the result.
  if (((a ^ b) & (a ^ wrapped)) < 0) return a < 0 ? -INT16_MAX : INT16_MAX;
  return wrapped < -INT16_MAX ? -INT16_MAX : wrapped;
}

/// Return value / 2^8 or value / 2^16, rounded to nearest (halves up), for results of 16 bits. On the chip
/// these shifts only select bytes. They are unsigned because gcc would otherwise compute an unused sign.
constexpr int16_t RoundShift8(int32_t value) {
  return static_cast<int16_t>(static_cast<uint32_t>(value + 0x80) >> 8);
}
constexpr int16_t RoundShift16(int32_t value) {
  return static_cast<int16_t>(static_cast<uint32_t>(value + 0x8000) >> 16);
}
static_assert(RoundShift8(-0x181) == -2 && RoundShift16(0x18000) == 2 && RoundShift16(-0x18001) == -2,
              "narrowing must keep the low bits");

}  // namespace fw
