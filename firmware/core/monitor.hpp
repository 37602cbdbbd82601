#pragma once
#include <stdint.h>

#include "core/config.hpp"
#include "core/fixed.hpp"

namespace fw {

/// Stall and wiring monitor of one side. Runs once per control tick.
///
/// Integrates |PWM| over time. The integral restarts when the wheel advances 3 counts in the commanded
/// direction. At 38 PWM s (after 300 ms at half PWM or more, later at less) the monitor decides. Fewer than
/// 3 counts either way are a stall, or a dead encoder or motor. 3 or more counts backwards, and still moving
/// backwards, are swapped wires. In any other case the integral restarts.
///
/// The integral thus limits how far a wheel can run away at any steady set-point. A wheel that is being
/// reversed turns round within that time. A command that changes sign more often than every 300 ms restarts
/// the integral each time; such a wheel only shakes.
class WheelMonitor {
 public:
  enum class Verdict : uint8_t { kFine, kStall, kReversed };

  /// count: encoder count now, mod 2^16; next_pwm: output from now on.
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
    if (progress_ >= kProgress || along == kProgress) {  // it advances, or has just turned round
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
  // 1.5 times the PWM that starts a wheel. A wheel with less may well be stationary.
  static constexpr int16_t kIdlePwm = 32;
  static constexpr int16_t kPushed = 38 * kControlRate_Hz;  // [PWM ticks]
  static constexpr int8_t kProgress = 3;
  static_assert(kPushed <= kMaxPwm / 2 * kFaultWindow_ticks && kPushed <= INT16_MAX - kMaxPwm,
                "above half PWM, 300 ms must be enough");

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

/// Reports more than 30 lost edges within 300 ms, both wheels together: noise or a loose wire. The 300 ms
/// window slides in steps of 100 ms.
class EdgeMonitor {
 public:
  /// Call once per control tick. lost: total so far, mod 2^16. Return true while there are too many.
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
  uint16_t starts_[3] = {};
  uint8_t ticks_ = 0;
};

/// Reports a current above the limit in three consecutive readings (0.3 s). A single peak at a start is not a
/// fault.
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

/// Debounces an input with a switch: bumper, cliff sensor or emergency stop.
class InputMonitor {
 public:
  /// Call about once per millisecond, never more often. mode: the parameter `input_1` or `input_2`. Return
  /// true while the input has been active for four calls: a switch bounces, and motors disturb long wires.
  bool Step(bool high, int16_t mode) {
    const bool active = high ? mode == kWhileHigh : mode == kWhileLow;
    if (!active) {
      calls_ = 0;
    } else if (calls_ < kDebounce) {
      ++calls_;
    }
    return calls_ == kDebounce;
  }

 private:
  static constexpr int16_t kWhileLow = 1, kWhileHigh = 2;
  static constexpr uint8_t kDebounce = 4;
  static_assert(kDebounce * 1000UL < kTick_us / 2, "the fault must come within one control tick");
  uint8_t calls_ = 0;
};

}  // namespace fw
