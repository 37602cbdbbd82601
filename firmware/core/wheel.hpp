#pragma once
#include <stdint.h>

#include "core/config.hpp"
#include "core/feedforward.hpp"
#include "core/pi.hpp"
#include "core/ramp.hpp"
#include "core/units.hpp"

namespace fw {

/// Constants of the wheel controllers, computed from the live parameters.
struct WheelConfig {
  PiGains pi;
  FeedForwardGains feed_forward;
  RampSteps ramp;
  SpeedScale speed;
  bool left_encoder_reversed, right_encoder_reversed;
};

/// Result of one control tick for one wheel.
struct WheelSample {
  int16_t speed_mrad_s;     ///< measured in the interval just ended
  int16_t setpoint_mrad_s;  ///< of the same interval
  int16_t pwm;              ///< for the next interval
  int16_t integral_pwm_64;  ///< [PWM/64]
};

/// Speed controller of one side: ramp, feed-forward and PI.
///
/// The ramp runs here, so the next set-point is known before its interval begins. The feed-forward drives
/// towards it. The PI corrects the difference between the measured speed and the model's prediction for that
/// interval. Without kv there is no model, and the PI acts on the newest set-point, as in the thesis.
class WheelController {
 public:
  /// speed_mrad_s: of the interval just ended. target_mrad_s: within +-17 rad/s.
  void Step(const WheelConfig& config, int16_t target_mrad_s, int16_t speed_mrad_s, WheelSample* sample) {
    const int16_t last = setpoint_mrad_s_;
    const int16_t next = Ramp(last, target_mrad_s, config.ramp);
    const int16_t wanted = config.feed_forward.kv != 0 ? feed_forward_.predicted() : next;
    const int32_t output = feed_forward_.Step(config.feed_forward, last, next);
    // What overcame friction until now would keep the stopped wheel creeping.
    if (next == 0 && setpoint_mrad_s_ != 0) pi_.Reset();
    setpoint_mrad_s_ = next;
    sample->speed_mrad_s = speed_mrad_s;
    sample->setpoint_mrad_s = last;
    sample->pwm = pi_.Step(config.pi, Difference(wanted, speed_mrad_s), output, next == 0);
    sample->integral_pwm_64 = IntegralInPwm64(pi_.integral());
  }

  /// Track the measured speed while the loop is open; clear everything else. When the loop closes again, the
  /// model expects a wheel that still rolls to coast down. From a model speed of zero, the PI would brake it
  /// until it ran backwards.
  void TrackSpeed(int16_t speed_mrad_s) {
    pi_.Reset();
    feed_forward_.TrackSpeed(speed_mrad_s);
    setpoint_mrad_s_ = 0;
  }

 private:
  PiController pi_;
  FeedForward feed_forward_;
  int16_t setpoint_mrad_s_ = 0;
};

}  // namespace fw
