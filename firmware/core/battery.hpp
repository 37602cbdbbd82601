#pragma once
#include <stdint.h>

#include "core/config.hpp"

namespace fw {

/// Battery voltage: filtered over about 1.5 s (16 readings of 96 ms), so that a start-up dip is no empty
/// battery, and a `low` with hysteresis.
class Battery {
 public:
  /// Take a reading; true at the moment the battery becomes low.
  bool Update(uint16_t reading_mV) {
    sum_ = sum_ == 0 ? uint32_t(reading_mV) * 16 : sum_ - filtered_mV() + reading_mV;
    const bool was_low = low_;
    const uint16_t now_mV = filtered_mV();
    if (now_mV < kBatteryStop_mV) low_ = true;
    if (now_mV > kBatteryRearm_mV) low_ = false;
    return low_ && !was_low;
  }

  uint16_t filtered_mV() const { return static_cast<uint16_t>(sum_ / 16); }  ///< 0 before the first reading
  bool low() const { return low_; }
  bool warning() const { return sum_ != 0 && filtered_mV() < kBatteryRearm_mV; }

 private:
  uint32_t sum_ = 0;  // 16 times the filtered voltage
  bool low_ = false;
};

}  // namespace fw
