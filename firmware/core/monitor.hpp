#pragma once
#include <stdint.h>

#include "core/config.hpp"

namespace fw {

/// Does the wheel go where its motor pushes? Watches one side, once a control tick.
///
/// The time starts anew whenever the wheel gets on: by 3 counts the way it is pushed. After 300 ms without
/// that, fewer than 3 counts either way is a stall (or a dead encoder or motor); more of them backwards, and
/// still going, is a swapped wire. A wheel that is being reversed turns round within that time.
class WheelMonitor {
 public:
  enum class Verdict : uint8_t { kFine, kStall, kReversed };

  /// count: now, mod 2^16; next_pwm: what is applied from now on.
  Verdict Step(uint16_t count, int16_t next_pwm) {
    const int16_t counts = static_cast<int16_t>(count - count_);
    const int16_t pwm = pwm_;
    count_ = count;
    pwm_ = next_pwm;
    const bool forward = pwm > 0;
    if (forward != forward_ || (pwm <= kStallPwm && pwm >= -kStallPwm)) Restart();
    forward_ = forward;
    if (pwm <= kStallPwm && pwm >= -kStallPwm) return Verdict::kFine;
    const int16_t along = forward ? Clip(counts) : static_cast<int16_t>(-Clip(counts));
    progress_ = Clip(static_cast<int16_t>(progress_ + along));
    if (progress_ >= kProgress) {
      Restart();
    } else if (++ticks_ >= kWindow) {
      const bool still = progress_ > -kProgress;
      const bool backwards = along < 0;
      Restart();
      return still ? Verdict::kStall : backwards ? Verdict::kReversed : Verdict::kFine;
    }
    return Verdict::kFine;
  }

 private:
  static constexpr int16_t kStallPwm = kMaxPwm / 2;
  static constexpr int16_t kProgress = 3;
  static constexpr uint8_t kWindow = kFaultWindow_ticks;
  static constexpr int16_t Clip(int16_t value) { return value > 8000 ? 8000 : value < -8000 ? -8000 : value; }

  void Restart() {
    progress_ = 0;
    ticks_ = 0;
  }

  uint16_t count_ = 0;
  int16_t pwm_ = 0, progress_ = 0;
  uint8_t ticks_ = 0;
  bool forward_ = false;
};

/// More than 30 lost edges within 300 ms, both wheels together: noise, or a loose wire.
class EdgeMonitor {
 public:
  /// Once a control tick; lost: in all so far, mod 2^16. True while there are too many.
  bool Step(uint16_t lost) {
    if (++ticks_ >= kFaultWindow_ticks) {
      ticks_ = 0;
      start_ = lost;
    }
    return static_cast<uint16_t>(lost - start_) > kMaxLost;
  }

 private:
  static constexpr uint16_t kMaxLost = 30;
  uint16_t start_ = 0;
  uint8_t ticks_ = 0;
};

/// A current above the limit in three readings in a row (0.3 s): one peak at a start is no fault.
class CurrentMonitor {
 public:
  bool Step(int16_t left_mA, int16_t right_mA, int16_t limit_mA) {
    if (left_mA > limit_mA || left_mA < -limit_mA || right_mA > limit_mA || right_mA < -limit_mA) {
      if (over_ < kReadings) ++over_;
    } else {
      over_ = 0;
    }
    return over_ == kReadings;
  }

 private:
  static constexpr uint8_t kReadings = 3;
  uint8_t over_ = 0;
};

}  // namespace fw
