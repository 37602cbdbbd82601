#pragma once
#include <stdint.h>

#include "core/config.hpp"
#include "core/fixed.hpp"
#include "core/pi.hpp"

namespace fw {

/// Feed-forward gains of one wheel and the matching prediction, precomputed for the control tick.
///
/// Wheel model: tau dv/dt + v = w. The output is constant over a tick T; w [mrad/s] is the steady-state speed
/// that it would give. The measured speed y is v averaged over the tick, so exactly
///   v[k+1] = w[k] + a (v[k] - w[k]),  a = exp(-T/tau)
///   y[k+1] = w[k] + b (v[k] - w[k]),  b = (1-a) tau/T.
struct FeedForwardGains {
  int32_t friction;  ///< [PWM] Q19, at the current battery voltage
  int16_t kv;        ///< [PWM / (mrad/s)] Q19, likewise; 0 = no speed feed-forward, no prediction
  int16_t lead;      ///< tau/T, Q8
  int16_t decay;     ///< a, Q15
  int16_t mean;      ///< b, Q15
};

constexpr int16_t kMaxLead_mrad_s = 7000;  ///< limit of how far the feed-forward's input leads the set-point

/// Compute the constants that depend only on the wheel's time constant. It divides, so it does not run in the
/// control tick. kv, ka: Q19 per mrad, within the ranges of their parameters. ramp_step_mrad_s: largest
/// change of the set-point per tick. 0 = unlimited; then there is no lead, because the lead is designed for
/// ramps.
inline void DeriveModel(int16_t kv, int16_t ka, int16_t ramp_step_mrad_s, FeedForwardGains* gains) {
  gains->lead = 0;
  gains->decay = 0;
  gains->mean = 0;
  if (kv == 0 || ka == 0) return;  // no time constant: the prediction is the set-point itself
  // tau/T, Q8: 42 (1/6: below it the wheel settles well within a tick) to 30 ticks.
  const uint32_t ka_ticks = uint32_t(ka) * kControlRate_Hz;
  const uint32_t exact = (ka_ticks << 8) / static_cast<uint16_t>(kv);
  if (exact < 42) return;
  const uint16_t ticks = exact < 30 * 256 ? static_cast<uint16_t>(exact) : 30 * 256;
  if (ramp_step_mrad_s != 0) {
    const uint32_t most = kMaxLead_mrad_s * 256UL / static_cast<uint16_t>(ramp_step_mrad_s);
    gains->lead = static_cast<int16_t>(ticks < most ? ticks : most);
  }
  // exp(-T/tau) = (1 - z + z^2/2)^8 with z = T/(8 tau), Q15. The error is below 0.006 for every z here.
  const uint16_t z = static_cast<uint16_t>((1UL << 20) / ticks);
  uint16_t a = static_cast<uint16_t>(32768 - z + (uint32_t(z) * z >> 16));
  for (uint8_t i = 0; i < 3; ++i) a = static_cast<uint16_t>(uint32_t(a) * a >> 15);
  gains->decay = static_cast<int16_t>(a);
  gains->mean = static_cast<int16_t>(uint32_t(32768 - a) * ticks >> 8);
}

/// Nominal over measured battery voltage, Q12, limited to 1/2 ... 3/2; 1 while the voltage is unknown (0).
inline uint16_t SupplyRatio(uint16_t battery_mV, uint16_t nominal_mV) {
  const uint16_t low = static_cast<uint16_t>((nominal_mV * 2UL + 2) / 3);
  const uint16_t high = static_cast<uint16_t>(nominal_mV * 2);
  if (battery_mV == 0) return 1 << 12;
  const uint16_t used = battery_mV < low ? low : battery_mV > high ? high : battery_mV;
  return static_cast<uint16_t>((uint32_t(nominal_mV) << 12) / used);
}

/// Compute the gains that depend on the battery voltage. ks: Q7, kv: Q19 per mrad.
inline void ScaleToSupply(int16_t ks, int16_t kv, uint16_t supply_ratio, FeedForwardGains* gains) {
  gains->friction = int32_t(ks) * supply_ratio;  // Q7 * Q12
  gains->kv = static_cast<int16_t>(Limit((int32_t(kv) * supply_ratio + (1 << 11)) >> 12, INT16_MAX));
}

class FeedForward {
 public:
  /// Return the output that moves the wheel from one set-point to the next within the coming tick: PWM Q19,
  /// |.| <= kFeedForwardMax.
  int32_t Step(const FeedForwardGains& gains, int16_t from_mrad_s, int16_t to_mrad_s) {
    const int16_t change =
        static_cast<int16_t>(static_cast<uint16_t>(to_mrad_s) - static_cast<uint16_t>(from_mrad_s));
    const int16_t input = static_cast<int16_t>(to_mrad_s + RoundShift8(Product(gains.lead, change)));
    const int16_t away = Difference(speed_, input);
    predicted_ = static_cast<int16_t>(input + RoundShift16(Product(gains.mean, away) * 2));
    // Round towards zero so that the model converges. Rounded to nearest, a slow wheel's model would stop a
    // few mrad/s short.
    int32_t left = Product(gains.decay, away) * 2;
    if (left < 0) left += 0xFFFF;
    speed_ = static_cast<int16_t>(input + static_cast<int16_t>(static_cast<uint32_t>(left) >> 16));

    int32_t output = Product(gains.kv, input);
    if (to_mrad_s > 0) output += gains.friction;
    if (to_mrad_s < 0) output -= gains.friction;
    return output;
  }

  /// Average speed that the model expects in the tick just begun [mrad/s].
  int16_t predicted() const { return predicted_; }

  /// Set the model's speed to the measured speed.
  void TrackSpeed(int16_t speed_mrad_s) {
    speed_ = speed_mrad_s;
    predicted_ = speed_mrad_s;
  }

 private:
  static_assert(int64_t(INT16_MAX) * (kMaxSpeed_mrad_s + kMaxLead_mrad_s) + 12800L * 6144 <= kFeedForwardMax,
                "the largest kv and ks must fit the feed-forward range of the PI");

  int16_t speed_ = 0;      // [mrad/s] model speed now
  int16_t predicted_ = 0;  // [mrad/s] model speed, mean over the tick
};

}  // namespace fw
