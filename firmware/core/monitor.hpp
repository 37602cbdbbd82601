#pragma once
#include <stdint.h>

#include "core/config.hpp"
#include "core/fixed.hpp"

namespace fw {

/// Does the wheel go where its motor pushes? Watches one side, once a control tick.
///
/// PWM times time is summed up while the wheel does not get on, by 3 counts the way it is pushed, and starts
/// anew when it does. At 38 PWM s (half PWM for 300 ms, less PWM for longer, more than half for 300 ms too),
/// fewer than 3 counts either way is a stall (or a dead encoder or motor); more of them backwards, and still
/// going, is a swapped wire. So the sum bounds the way that a wheel runs unseen at any steady set-point; and
/// a wheel that is being reversed turns round within that time. (A push that changes its sign more often than
/// each 300 ms begins anew each time: such a wheel is only shaken.)
class WheelMonitor {
 public:
  enum class Verdict : uint8_t { kFine, kStall, kReversed };

  /// count: now, mod 2^16; next_pwm: what is applied from now on.
  Verdict Step(uint16_t count, int16_t next_pwm) {
    const int16_t counts = static_cast<int16_t>(count - count_);
    const bool forward = pwm_ > 0;
    const int16_t push = forward ? pwm_ : static_cast<int16_t>(-pwm_);
    count_ = count;
    pwm_ = next_pwm;
    if (forward != forward_ || push <= kIdlePwm) Restart();
    forward_ = forward;
    if (push <= kIdlePwm) return Verdict::kFine;
    int8_t along = static_cast<int8_t>(counts > kProgress    ? kProgress
                                       : counts < -kProgress ? -kProgress
                                                             : counts);
    if (!forward) along = static_cast<int8_t>(-along);
    progress_ = static_cast<int8_t>(progress_ + along);
    if (progress_ < -kProgress) progress_ = -kProgress;
    pushed_ = static_cast<int16_t>(pushed_ + push);
    if (progress_ >= kProgress || along == kProgress) {  // it gets on, or has just turned round
      Restart();
    } else if (++ticks_ >= kFaultWindow_ticks && pushed_ >= kPushed) {
      const bool still = progress_ > -kProgress;
      const bool backwards = along < 0;
      Restart();
      return still ? Verdict::kStall : backwards ? Verdict::kReversed : Verdict::kFine;
    }
    return Verdict::kFine;
  }

 private:
  static constexpr int16_t kIdlePwm = 32;  // half as much again as starts a wheel: below it may well stand
  static constexpr int16_t kPushed = 38 * kControlRate_Hz;  // [PWM ticks]
  static constexpr int8_t kProgress = 3;
  static_assert(kPushed <= kMaxPwm / 2 * kFaultWindow_ticks && kPushed <= INT16_MAX - kMaxPwm,
                "over half PWM, 300 ms are enough");

  void Restart() {
    progress_ = 0;
    pushed_ = 0;
    ticks_ = 0;
  }

  uint16_t count_ = 0;
  int16_t pwm_ = 0, pushed_ = 0;
  int8_t progress_ = 0;
  uint8_t ticks_ = 0;
  bool forward_ = false;
};

/// More than 30 lost edges within 300 ms, both wheels together: noise, or a loose wire. The 300 ms slide in
/// steps of 100 ms.
class EdgeMonitor {
 public:
  /// Once a control tick; lost: in all so far, mod 2^16. True while there are too many.
  bool Step(uint16_t lost) {
    const bool noisy = static_cast<uint16_t>(lost - starts_[0]) > kMaxLost;
    if (++ticks_ >= kControlRate_Hz / 10) {
      ticks_ = 0;
      starts_[0] = starts_[1];
      starts_[1] = starts_[2];
      starts_[2] = lost;
    }
    return noisy;
  }

 private:
  static constexpr uint16_t kMaxLost = 30;
  uint16_t starts_[3] = {0, 0, 0};
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
