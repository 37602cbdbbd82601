#pragma once
#include <stdint.h>

#include "core/fixed.hpp"

namespace fw {

/// Heading from the yaw rate of a gyroscope with 32.8 LSB per deg/s, and the calibration of its bias. The
/// bias is the mean of 1024 readings of a stationary robot. It is measured again whenever the robot is
/// stationary, because it drifts with the temperature.
class GyroHeading {
 public:
  /// Take a reading. stationary: the motors are off and the wheels do not turn. Return false if the last 100
  /// readings are equal: noise changes the reading of a gyroscope that measures.
  __attribute__((noinline)) bool Measure(int16_t rate, bool stationary) {
    if (rate != rate_) same_ = 0;
    rate_ = rate;
    if (same_ == kFrozen) return false;
    ++same_;
    // Someone may be turning the robot. No bias exceeds 20 deg/s (data sheet, ZRO).
    const bool steady =
        Within(static_cast<int16_t>(static_cast<uint16_t>(rate) - static_cast<uint16_t>(first_)), kSpread) &&
        Within(rate, kMaxBias);
    if (!stationary || !steady) {
      first_ = rate;
    } else {
      sum_ += rate;
      if (++readings_ != kWindow) return true;
      bias_turn_ = (sum_ * kTurn) >> 10;
      calibrated_ = true;
    }
    sum_ = 0;
    readings_ = 0;
    return true;
  }

  /// Turn with the rate of the last reading for this time.
  __attribute__((noinline)) void Advance(uint8_t elapsed_ms) {
    const int32_t turn = (Product(rate_, kTurn) - bias_turn_) >> 2;
    for (uint8_t ms = elapsed_ms; ms != 0; --ms) angle_ += static_cast<uint32_t>(turn);
  }

  bool calibrated() const { return calibrated_; }
  uint16_t heading() const { return static_cast<uint16_t>(angle_ >> 16); }  ///< [rev/65536], about the z axis

 private:
  static constexpr uint8_t kFrozen = 100;
  static constexpr int16_t kSpread = 33, kMaxBias = 656;  // 1 and 20 deg/s
  static constexpr int16_t kWindow = 1024;
  static constexpr int16_t kTurn = 1455;  // of one LSB in a millisecond [rev / 2^34]
  static_assert(kTurn == ((1ULL << 34) + 360ULL * 16400) / (360ULL * 32800), "rounded 2^34 / 360 / 32800");
  static_assert(int64_t(kMaxBias) * kWindow * kTurn <= INT32_MAX && kWindow == 1 << 10,
                "the bias must fit int32");

  static bool Within(int16_t value, int16_t limit) {
    return static_cast<uint16_t>(value + limit) <= static_cast<uint16_t>(2 * limit);
  }

  int16_t rate_ = 0, first_ = 0, readings_ = 0;
  uint8_t same_ = 0;
  bool calibrated_ = false;
  int32_t sum_ = 0, bias_turn_ = 0;
  uint32_t angle_ = 0;  // [rev / 2^32]
};

}  // namespace fw
