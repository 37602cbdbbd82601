#pragma once
#include <stdint.h>

#include "core/config.hpp"
#include "core/messages.hpp"

namespace fw {

/// Thresholds of the whole battery.
struct BatteryLimits {
  uint16_t stop_mV, rearm_mV, high_mV;
};

/// Battery voltage, filtered over about 1.5 s (16 readings of 96 ms) so that the voltage dip of a motor start
/// does not count as an empty battery. Stopping and arming use different thresholds (hysteresis). After a
/// reset the battery counts as charged only once a reading proves it. A voltage that no such pack has is a
/// fault too: low battery could not be detected.
class Battery {
 public:
  /// Add a reading. Return LOW_BATTERY at the moment the battery becomes empty, HIGH_BATTERY while it is
  /// implausibly high, else NONE.
  Fault Update(uint16_t reading_mV, const BatteryLimits& limits) {
    sum_ = sum_ == 0 ? uint32_t(reading_mV) * 16 : sum_ - filtered_mV() + reading_mV;
    const bool was_empty = empty_;
    const uint16_t now_mV = filtered_mV();
    if (now_mV < limits.stop_mV) {
      empty_ = true;
      charged_ = false;
    } else if (now_mV > limits.rearm_mV) {  // also if the parameters have it below the stop limit
      empty_ = false;
      charged_ = true;
    }
    warning_ = now_mV < limits.rearm_mV;
    high_ = now_mV > limits.high_mV;
    if (high_) return Fault::kHighBattery;
    return empty_ && !was_empty ? Fault::kLowBattery : Fault::kNone;
  }

  /// Return OK if the charge is enough to arm, else BATTERY_LOW, BATTERY_HIGH or BATTERY_UNKNOWN.
  AckStatus status() const {
    if (high_) return AckStatus::kBatteryHigh;
    return charged_ ? AckStatus::kOk : sum_ != 0 ? AckStatus::kBatteryLow : AckStatus::kBatteryUnknown;
  }
  uint16_t filtered_mV() const { return static_cast<uint16_t>(sum_ / 16); }  ///< 0 before the first reading
  bool warning() const { return warning_; }

 private:
  uint32_t sum_ = 0;  // 16 times the filtered voltage
  bool empty_ = false, charged_ = false, warning_ = false, high_ = false;
};

}  // namespace fw
