#pragma once
#include <stdint.h>

#include "core/config.hpp"
#include "core/fixed.hpp"

namespace fw {

/// Outputs and integral inside the controller: PWM with 19 fractional bits.
constexpr uint8_t kOutputBits = 19;
constexpr int32_t OutputFromPwm(int32_t pwm) { return pwm << kOutputBits; }
constexpr int32_t kOutputMax = OutputFromPwm(kMaxPwm);

/// Return `output` limited to +-kOutputMax. Compares the upper half only, which saves 10 cycles.
inline int32_t LimitOutput(int32_t output) {
  constexpr int16_t kMost = kOutputMax >> 16;
  static_assert(int32_t(kMost) << 16 == kOutputMax, "the lower half of the limit must be zero");
  const int16_t upper = static_cast<int16_t>(output >> 16);
  return upper >= kMost ? kOutputMax : upper < -kMost ? -kOutputMax : output;
}

/// Largest feed-forward that fits the PI's arithmetic.
constexpr int32_t kFeedForwardMax = OutputFromPwm(1700);

struct PiGains {
  int16_t kp, ki;  ///< [PWM / (mrad/s)] Q19; ki is applied once per tick
};
constexpr int16_t kMaxKp = 31457, kMaxKi = 15729;  ///< 60 and 30 PWM/(rad/s)
static_assert(int64_t(kMaxKp) * INT16_MAX + kFeedForwardMax + kOutputMax + (1L << 18) <= INT32_MAX,
              "proportional term, feed-forward and integral together must fit int32");

/// Return an integral in PWM/64, rounded.
inline int16_t IntegralInPwm64(int32_t integral) { return RoundShift16(EightTimes(integral)); }
static_assert(kOutputBits - 6 == 16 - 3 && int64_t(kOutputMax) * 8 <= INT32_MAX,
              "Q19 times 8 is Q6 times 2^16");

/// Discrete PI, u = Kp e + I, I += Ki e (thesis, eq. 3.4), in exact integer arithmetic: the products keep all
/// bits, and only the output is rounded. Anti-windup: the integral stops while the output is saturated and
/// the error would drive it further. It is also clamped to the output range.
class PiController {
 public:
  /// error: [mrad/s], > -32768. feed_forward: PWM Q19, |.| <= kFeedForwardMax. idle: the set-point is zero.
  /// Returns PWM in [-255, 255].
  int16_t Step(const PiGains& gains, int16_t error_mrad_s, int32_t feed_forward, bool idle) {
    if (idle && error_mrad_s == 0) integral_ = 0;  // no residual output inside the dead band
    const int32_t rest = Product(gains.kp, error_mrad_s) + feed_forward;
    const int32_t before = rest + integral_;
    const bool frozen = error_mrad_s > 0 ? before >= kOutputMax : before <= -kOutputMax;
    if (!frozen) integral_ = LimitOutput(integral_ + Product(gains.ki, error_mrad_s));
    const int32_t rounded = rest + integral_ + (int32_t(1) << (kOutputBits - 1));
    static_assert(kOutputBits - 16 == 3, "Eighth() takes the last three of these bits");
    const int16_t pwm = Eighth(static_cast<int16_t>(rounded >> 16));
    return pwm > kMaxPwm ? kMaxPwm : pwm < -kMaxPwm ? -kMaxPwm : pwm;
  }

  void Reset() { integral_ = 0; }
  int32_t integral() const { return integral_; }  ///< PWM Q19

 private:
  int32_t integral_ = 0;
};

}  // namespace fw
