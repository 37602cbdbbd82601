#pragma once
#include <stdint.h>

#include "core/config.hpp"
#include "core/feedforward.hpp"
#include "core/pi.hpp"
#include "core/ramp.hpp"
#include "core/units.hpp"

namespace fw {

/// Constants of the wheel controllers, derived from the live parameters.
struct WheelConfig {
  PiGains pi;
  FeedForwardGains feed_forward;
  int16_t ramp_step_mrad_s;
};

/// What one control tick did with one wheel.
struct WheelSample {
  int16_t speed_mrad_s;     ///< counted in the interval just ended
  int16_t setpoint_mrad_s;  ///< of the same interval
  int16_t pwm;              ///< for the interval that begins
};

/// One side's speed controller: ramp, feed-forward and PI.
///
/// The ramp is ours, so the next set-point is known before its interval begins: feed-forward drives towards
/// it, while the PI corrects the speed just counted against what the model expected there. Without kv there
/// is no model, and the PI acts on the newest set-point, as the thesis's does.
class WheelController {
 public:
  /// counts: of the interval just ended. target_mrad_s: any; limited to +-17 rad/s. supply_ratio: see
  /// SupplyRatio().
  WheelSample Step(const WheelConfig& config, int16_t target_mrad_s, int16_t counts, uint16_t supply_ratio) {
    WheelSample sample;
    sample.speed_mrad_s = SpeedFromCounts(counts);
    sample.setpoint_mrad_s = setpoint_mrad_s_;
    const int16_t target = static_cast<int16_t>(Limit(target_mrad_s, kMaxSpeed_mrad_s));
    setpoint_mrad_s_ = Ramp(setpoint_mrad_s_, target, config.ramp_step_mrad_s);
    const int32_t wanted = config.feed_forward.kv != 0 ? feed_forward_.predicted() : setpoint_mrad_s_;
    const int32_t output =
        feed_forward_.Step(config.feed_forward, sample.setpoint_mrad_s, setpoint_mrad_s_, supply_ratio);
    sample.pwm = pi_.Step(config.pi, wanted - sample.speed_mrad_s, output, setpoint_mrad_s_ == 0);
    return sample;
  }

  /// Forget everything: the next tick starts from standstill.
  void Reset() {
    pi_.Reset();
    feed_forward_.Reset();
    setpoint_mrad_s_ = 0;
  }

  int16_t integral_pwm_64() const {  ///< [PWM/64]
    return static_cast<int16_t>(RoundShift(pi_.integral(), kOutputBits - 6));
  }

 private:
  PiController pi_;
  FeedForward feed_forward_;
  int16_t setpoint_mrad_s_ = 0;
};

}  // namespace fw
