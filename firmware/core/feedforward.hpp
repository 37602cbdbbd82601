#pragma once
#include <stdint.h>

#include "core/config.hpp"
#include "core/fixed.hpp"
#include "core/pi.hpp"

namespace fw {

/// Feed-forward of one wheel and the prediction that belongs to it, ready for the control tick.
///
/// Model of the wheel: tau dv/dt + v = w, with w [mrad/s] the steady speed that the output would give. The
/// counted speed is v averaged over a tick T, so for a held input it is exactly
///   y[k+1] = a y[k] + (1-b) w[k] + (b-a) w[k-1],  a = exp(-T/tau),  b = (1-a) tau/T.
struct FeedForwardGains {
  int16_t ks;        ///< [PWM] Q7, against dry friction
  int16_t kv;        ///< [PWM / (mrad/s)] Q19; 0 = no feed-forward from speed, no prediction
  int16_t lead;      ///< tau/T, Q10
  int16_t now;       ///< 1-b, Q13
  int16_t previous;  ///< b-a, Q13
};

/// Derive the tick's constants. ks: Q7; kv, ka: Q19 per mrad; all within their parameter's range.
inline FeedForwardGains DeriveFeedForward(int16_t ks, int16_t kv, int16_t ka) {
  FeedForwardGains gains = {ks, kv, 0, 1 << 13, 0};
  if (kv == 0 || ka == 0) return gains;  // an instant wheel: the prediction is the set-point itself
  const int32_t ka_ticks = int32_t(ka) * kControlRate_Hz;  // ka / T
  // x = T/tau, Q12. Past 6 the wheel settles well within a tick; below 1/30 it would need over 30 ticks.
  const int32_t x = (int32_t(kv) << 12) / ka_ticks;
  if (x > 6 << 12) return gains;
  const int32_t x_used = x > (1 << 12) / 30 ? x : (1 << 12) / 30;
  gains.lead = static_cast<int16_t>((int32_t(1) << 22) / x_used);
  // exp(-x) as the [1/3] Pade fraction (1 - x/4) / (1 + 3x/4 + x^2/4 + x^3/24): within 0.02 for every x here.
  const uint32_t x2 = (uint32_t(x_used) * uint32_t(x_used)) >> 12;
  const uint32_t x3 = (x2 * uint32_t(x_used)) >> 12;
  const int32_t below = static_cast<int32_t>((1 << 12) + 3 * uint32_t(x_used) / 4 + x2 / 4 + x3 / 24);
  const int32_t above = (1 << 12) - x_used / 4;
  const int32_t a = above > 0 ? (above << 13) / below : 0;
  const int32_t b = (((int32_t(1) << 13) - a) << 12) / x_used;
  gains.now = static_cast<int16_t>((1 << 13) - b);
  gains.previous = static_cast<int16_t>(b - a);
  return gains;
}

/// Nominal over measured battery voltage, Q12, limited to 1/2 ... 3/2; 1 while the battery is unknown (0).
inline uint16_t SupplyRatio(uint16_t battery_mV) {
  constexpr uint16_t kLow = (kBatteryNominal_mV * 2UL + 2) / 3, kHigh = kBatteryNominal_mV * 2;
  if (battery_mV == 0) return 1 << 12;
  const uint16_t used = battery_mV < kLow ? kLow : battery_mV > kHigh ? kHigh : battery_mV;
  return static_cast<uint16_t>((uint32_t(kBatteryNominal_mV) << 12) / used);
}

class FeedForward {
 public:
  /// The output for moving from one set-point to the next within the coming tick: PWM Q19, |.| <= 1536 PWM.
  int32_t Step(const FeedForwardGains& gains, int16_t from_mrad_s, int16_t to_mrad_s, uint16_t supply_ratio) {
    const int32_t lead = RoundShift((int32_t(to_mrad_s) - from_mrad_s) * gains.lead, 10);
    const int32_t input = Limit(to_mrad_s + lead, kMaxInput_mrad_s);
    // A sum that never loses bits, as in the PI: the prediction settles on the set-point to the last mrad/s.
    const int32_t y = predicted();
    predicted_ += gains.now * (input - y) + gains.previous * (previous_input_ - y);
    previous_input_ = input;

    const int32_t friction = to_mrad_s > 0 ? gains.ks : to_mrad_s < 0 ? -gains.ks : 0;  // Q7
    const int32_t output = friction + RoundShift(gains.kv * input, kOutputBits - 7);    // Q7
    return Limit(output, kMaxOutputQ7) * supply_ratio;                                  // Q7 * Q12 = Q19
  }

  /// The counted speed that the model expects for the tick just begun [mrad/s].
  int32_t predicted() const { return RoundShift(predicted_, 13); }

  void Reset() { predicted_ = previous_input_ = 0; }

 private:
  static constexpr int32_t kMaxInput_mrad_s = 65535;
  static constexpr int32_t kMaxOutputQ7 = 1023L << 7;
  static_assert(int64_t(kMaxOutputQ7) * (3 << 11) <= int64_t(OutputFromPwm(1536)),
                "PI has room for 1536 PWM");
  static_assert(int64_t(kMaxInput_mrad_s) * 3 << 13 <= INT32_MAX, "the prediction's sum must fit int32");

  int32_t predicted_ = 0;       // [mrad/s] Q13
  int32_t previous_input_ = 0;  // [mrad/s]
};

}  // namespace fw
