#pragma once
#include <stdint.h>

namespace fw {

/// `value` limited to [-limit, limit].
constexpr int32_t Limit(int32_t value, int32_t limit) {
  return value > limit ? limit : value < -limit ? -limit : value;
}

/// value / 2^bits, rounded to nearest (halves up). The shift of a negative number is arithmetic in gcc.
constexpr int32_t RoundShift(int32_t value, uint8_t bits) {
  return (value + (int32_t(1) << (bits - 1))) >> bits;
}
static_assert(RoundShift(-3, 1) == -1 && RoundShift(3, 1) == 2, "the right shift must be arithmetic");

}  // namespace fw
