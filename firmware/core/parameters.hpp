#pragma once
#include <stdint.h>

#include "core/messages.hpp"
#include "core/wheel.hpp"

namespace fw {

constexpr int32_t Largest(Parameter parameter) {
  return kParameterRanges[static_cast<uint8_t>(parameter)].maximum;
}
static_assert(Largest(Parameter::kKp) <= INT16_MAX && Largest(Parameter::kKi) <= INT16_MAX &&
                  Largest(Parameter::kKs) <= INT16_MAX && Largest(Parameter::kKv) <= INT16_MAX &&
                  Largest(Parameter::kKa) <= INT16_MAX,
              "gains are 16-bit factors");

/// The live parameters, on the wire's scale. They start at their defaults after every reset.
class Parameters {
 public:
  Parameters() {
    for (uint8_t i = 0; i < kParameterCount; ++i) values_[i] = kParameterRanges[i].initial;
  }

  /// Set one parameter, or refuse and change nothing.
  AckStatus Set(uint8_t index, int32_t value) {
    if (index >= kParameterCount) return AckStatus::kUnknownParameter;
    if (value < kParameterRanges[index].minimum || value > kParameterRanges[index].maximum) {
      return AckStatus::kOutOfRange;
    }
    values_[index] = value;
    return AckStatus::kOk;
  }

  /// index < kParameterCount.
  int32_t Get(uint8_t index) const { return values_[index]; }

  /// The controllers' constants that follow from the parameters.
  WheelConfig Derive() const {
    return {{Short(Parameter::kKp), Short(Parameter::kKi)},
            DeriveFeedForward(Short(Parameter::kKs), Short(Parameter::kKv), Short(Parameter::kKa)),
            RampStep(Value(Parameter::kAcceleration))};
  }

 private:
  int32_t Value(Parameter parameter) const { return values_[static_cast<uint8_t>(parameter)]; }
  int16_t Short(Parameter parameter) const { return static_cast<int16_t>(Value(parameter)); }

  int32_t values_[kParameterCount];
};

}  // namespace fw
