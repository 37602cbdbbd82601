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

/// Largest set-point changes per tick [mrad/s]. speed_up 0: no ramp.
struct RampSteps {
  int16_t speed_up, slow_down;

  constexpr int16_t Largest() const { return speed_up != 0 && slow_down > speed_up ? slow_down : speed_up; }
};

/// Make the steps of two limits [0.01 rad/s^2]; deceleration 0 = as acceleration.
constexpr RampSteps MakeRampSteps(int16_t acceleration, int16_t deceleration) {
  return {RampStep(acceleration), RampStep(deceleration == 0 ? acceleration : deceleration)};
}

/// Return the next set-point: towards `target` by at most one step. Before a reversal, fast
/// braking ends at zero. Inlined, it would take the control tick's registers.
__attribute__((noinline)) inline int16_t Ramp(int16_t setpoint_mrad_s, int16_t target_mrad_s,
                                              RampSteps steps) {
  uint16_t step = uint16_t(steps.speed_up);
  if (step == 0) return target_mrad_s;
  const bool up = target_mrad_s > setpoint_mrad_s;
  // Unsigned, because a reversal exceeds int16.
  uint16_t gap = static_cast<uint16_t>(uint16_t(target_mrad_s) - uint16_t(setpoint_mrad_s));
  if (!up) gap = static_cast<uint16_t>(-gap);
  if (gap > step && (up ? setpoint_mrad_s < -steps.speed_up : setpoint_mrad_s > steps.speed_up)) {
    step = uint16_t(steps.slow_down);
    if ((target_mrad_s ^ setpoint_mrad_s) < 0) {
      target_mrad_s = 0;
      gap = up ? static_cast<uint16_t>(-setpoint_mrad_s) : uint16_t(setpoint_mrad_s);
    }
  }
  if (gap <= step) return target_mrad_s;
  return static_cast<int16_t>(setpoint_mrad_s + (up ? step : -step));
}

}  // namespace fw
