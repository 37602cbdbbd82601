#pragma once
#include <stdint.h>

#include "core/battery.hpp"
#include "core/messages.hpp"
#include "core/wheel.hpp"

namespace fw {

constexpr int16_t Largest(Parameter parameter) {
  return kParameterRanges[static_cast<uint8_t>(parameter)].maximum;
}
static_assert(Largest(Parameter::kKp) <= kMaxKp && Largest(Parameter::kKi) <= kMaxKi,
              "the PI is verified up to these gains");
static_assert(Largest(Parameter::kKs) <= 12800, "the PI's feed-forward range must hold the largest ks");

/// From this parameter on they describe the robot. They change only while the motors are off.
constexpr uint8_t kFirstRobotParameter = static_cast<uint8_t>(Parameter::kCountsPerRev);

/// The live parameters as wire values.
class Parameters {
 public:
  Parameters() { Restore(); }

  /// Restore the defaults.
  void Restore() {
    for (uint8_t i = 0; i < kParameterCount; ++i) values_[i] = ReadFlash(&kParameterRanges[i].initial);
  }

  /// Set one parameter. Out of range, return the error and change nothing.
  AckStatus Set(uint8_t index, int16_t value) {
    if (index >= kParameterCount) return AckStatus::kUnknownParameter;
    const ParameterRange& range = kParameterRanges[index];
    if (value < ReadFlash(&range.minimum) || value > ReadFlash(&range.maximum)) {
      return AckStatus::kOutOfRange;
    }
    values_[index] = value;
    return AckStatus::kOk;
  }

  /// index < kParameterCount.
  int16_t Get(uint8_t index) const { return values_[index]; }
  int16_t Get(Parameter parameter) const { return values_[static_cast<uint8_t>(parameter)]; }

  /// Compute the controllers' constants at this battery voltage.
  void Derive(uint16_t battery_mV, WheelConfig* config) const {
    config->pi = {Get(Parameter::kKp), Get(Parameter::kKi)};
    config->ramp = MakeRampSteps(Get(Parameter::kAcceleration), Get(Parameter::kDeceleration));
    DeriveModel(Get(Parameter::kKv), Get(Parameter::kKa), config->ramp.Largest(), &config->feed_forward);
    ScaleToSupply(Get(Parameter::kKs), Get(Parameter::kKv), SupplyRatio(battery_mV, OfCells(kCellNominal_mV)),
                  &config->feed_forward);
    config->speed = MakeSpeedScale(static_cast<uint16_t>(Get(Parameter::kCountsPerRev)));
    config->left_encoder_reversed = IsSet(Parameter::kLeftEncoderReversed);
    config->right_encoder_reversed = IsSet(Parameter::kRightEncoderReversed);
  }

  bool IsSet(Parameter parameter) const { return Get(parameter) != 0; }

  BatteryLimits battery_limits() const {
    const uint16_t high_mV = OfCells(kCellHigh_mV);
    return {OfCells(Get(Parameter::kBatteryStop)), OfCells(Get(Parameter::kBatteryRearm)),
            high_mV < kBoardHigh_mV ? high_mV : kBoardHigh_mV};
  }

 private:
  uint16_t OfCells(uint16_t cell_mV) const {
    return static_cast<uint16_t>(cell_mV * static_cast<uint16_t>(Get(Parameter::kBatteryCells)));
  }

  int16_t values_[kParameterCount];
};

}  // namespace fw
