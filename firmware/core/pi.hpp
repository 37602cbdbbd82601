#pragma once
#include <stdint.h>

#include "core/config.hpp"
#include "core/fixed.hpp"

namespace fw {

/// Outputs and integral inside the controller: PWM with 19 fractional bits. The largest sum, 1024 (P) + 255
/// (I) + 1536 (feed-forward), stays below 2^31.
constexpr uint8_t kOutputBits = 19;
constexpr int32_t OutputFromPwm(int32_t pwm) { return pwm << kOutputBits; }
constexpr int32_t kOutputMax = OutputFromPwm(kMaxPwm);

struct PiGains {
  int16_t kp, ki;  ///< [PWM / (mrad/s)] Q19; ki is added once a tick
};

/// Discrete PI, u = Kp e + I, I += Ki e (thesis, eq. 3.4), exact in integers: the products are never
/// shortened, one rounding at the output. The integral alone is frozen, and only while the output is
/// saturated and the error pushes it further out; it is clamped to the output's range too.
class PiController {
 public:
  /// error: [mrad/s], any int32. feed_forward: PWM Q19, |.| <= 1536 PWM. idle: the set-point is zero.
  /// Returns PWM in [-255, 255].
  int16_t Step(const PiGains& gains, int32_t error_mrad_s, int32_t feed_forward, bool idle) {
    const int32_t error = Limit(error_mrad_s, kMaxError_mrad_s);
    if (idle && error == 0) integral_ = 0;  // no tiny output left inside the dead band
    // Beyond 1024 PWM the output is saturated whatever integral and feed-forward add.
    const int32_t rest = Limit(gains.kp * error, OutputFromPwm(1024)) + feed_forward;
    const int32_t before = rest + integral_;
    const bool frozen = (before >= kOutputMax && error > 0) || (before <= -kOutputMax && error < 0);
    if (!frozen) integral_ = Limit(integral_ + gains.ki * error, kOutputMax);
    return static_cast<int16_t>(RoundShift(Limit(rest + integral_, kOutputMax), kOutputBits));
  }

  void Reset() { integral_ = 0; }
  int32_t integral() const { return integral_; }  ///< PWM Q19

 private:
  // Twice the int16 range of a speed: never reached by a real error, and gains * error still fits int32.
  static constexpr int32_t kMaxError_mrad_s = 65535;
  static_assert(int64_t(INT16_MAX) * kMaxError_mrad_s <= INT32_MAX, "a gain times an error must fit int32");

  int32_t integral_ = 0;
};

}  // namespace fw
