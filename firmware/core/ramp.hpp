#pragma once
#include <stdint.h>

#include "core/config.hpp"

namespace fw {

/// Largest set-point change per tick [mrad/s] for an acceleration limit [0.01 rad/s^2]; 0 = no limit.
constexpr int16_t RampStep(int16_t acceleration_10mrad_s2) {
  constexpr uint8_t kDivisor = kControlRate_Hz / 10;
  static_assert(kControlRate_Hz % 10 == 0, "the divisor must be exact");
  return acceleration_10mrad_s2 == 0 ? 0
         : acceleration_10mrad_s2 < kDivisor
             ? 1  // the smallest step; 0 would mean "no limit"
             : static_cast<int16_t>((acceleration_10mrad_s2 + kDivisor / 2) / kDivisor);
}

/// Return the next set-point: towards `target`, by at most `step` (0 = at once).
inline int16_t Ramp(int16_t setpoint_mrad_s, int16_t target_mrad_s, int16_t step_mrad_s) {
  if (step_mrad_s == 0) return target_mrad_s;
  // Unsigned, because a reversal exceeds int16.
  if (target_mrad_s > setpoint_mrad_s) {
    const uint16_t gap = static_cast<uint16_t>(uint16_t(target_mrad_s) - uint16_t(setpoint_mrad_s));
    return gap > uint16_t(step_mrad_s) ? static_cast<int16_t>(setpoint_mrad_s + step_mrad_s) : target_mrad_s;
  }
  const uint16_t gap = static_cast<uint16_t>(uint16_t(setpoint_mrad_s) - uint16_t(target_mrad_s));
  return gap > uint16_t(step_mrad_s) ? static_cast<int16_t>(setpoint_mrad_s - step_mrad_s) : target_mrad_s;
}

}  // namespace fw
