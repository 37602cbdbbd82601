#pragma once
#include <stdint.h>

#include "core/messages.hpp"

namespace fw {

/// Detects a tilted robot and an impact from an analogue accelerometer of 3.3 V (MMA7361L). Its outputs are
/// read with 8 bits of 5 V, 51.2 counts per volt.
class AccelerationMonitor {
 public:
  /// Take a reading of x, y and z. Call every 3 ms. tilt_limit: least reading of z above its zero, 0 = none,
  /// negative: the axis points down. impact_limit: largest change of the vector between two readings, 0 =
  /// none. Return TILTED after 0.3 s, IMPACT at once, else NONE.
  Fault Step(const uint8_t (&reading)[3], int16_t tilt_limit, int16_t impact_limit) {
    const int16_t z = static_cast<int16_t>(reading[2] - kZero);
    const bool tilted = tilt_limit < 0 ? z > tilt_limit : tilt_limit != 0 && z < tilt_limit;
    // Up and down, because an impact or vibration must neither stop the robot nor delay the stop.
    if (tilted && tilted_ < kTilted) ++tilted_;
    if (!tilted && tilted_ != 0) --tilted_;
    const bool known = last_[2] != 0;  // no output is 0 V
    uint32_t change = 0;
    for (uint8_t axis = 0; axis < 3; ++axis) {
      const int16_t step = static_cast<int16_t>(reading[axis] - last_[axis]);
      last_[axis] = reading[axis];
      change += static_cast<uint32_t>(int32_t(step) * step);
    }
    if (known && impact_limit != 0 && change > static_cast<uint32_t>(int32_t(impact_limit) * impact_limit)) {
      return Fault::kImpact;
    }
    return tilted_ == kTilted ? Fault::kTilted : Fault::kNone;
  }

 private:
  static constexpr int16_t kZero = 84;     // 1.65 V
  static constexpr uint8_t kTilted = 100;  // 0.3 s
  uint8_t last_[3] = {}, tilted_ = 0;
};

}  // namespace fw
