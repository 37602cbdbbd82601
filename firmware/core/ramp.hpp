#pragma once
#include <stdint.h>

#include "core/config.hpp"

namespace fw {

/// Largest change of a set-point in one tick [mrad/s] for an acceleration limit [mrad/s^2]; 0 = no limit.
constexpr int16_t RampStep(int32_t acceleration_mrad_s2) {
  return acceleration_mrad_s2 == 0 ? 0
         : acceleration_mrad_s2 < kControlRate_Hz
             ? 1  // slower than one step a tick cannot be expressed, and must not mean "no limit"
             : static_cast<int16_t>((acceleration_mrad_s2 + kControlRate_Hz / 2) / kControlRate_Hz);
}

/// The set-point one tick on: towards `target`, by at most `step` (0 = at once).
constexpr int16_t Ramp(int16_t setpoint_mrad_s, int16_t target_mrad_s, int16_t step_mrad_s) {
  // 32 bits: a reversal spans more than an int16.
  return step_mrad_s == 0 ? target_mrad_s
         : int32_t(target_mrad_s) - setpoint_mrad_s > step_mrad_s
             ? static_cast<int16_t>(setpoint_mrad_s + step_mrad_s)
         : int32_t(setpoint_mrad_s) - target_mrad_s > step_mrad_s
             ? static_cast<int16_t>(setpoint_mrad_s - step_mrad_s)
             : target_mrad_s;
}

}  // namespace fw
