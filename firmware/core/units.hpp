#pragma once
#include <stdint.h>

#include "core/config.hpp"
#include "core/fixed.hpp"

namespace fw {

/// Speed of one count per tick [mrad/s], in two parts, and the largest number of counts whose speed fits the
/// wire's int16.
struct SpeedScale {
  int16_t whole, fraction;  ///< fraction: Q16, -1/2 to 1/2
  int16_t max_counts;
};

/// Compute the scale for an encoder. It divides, so it does not run in the control tick. Integer arithmetic,
/// because the chip's double has only 4 bytes: chip and host build agree bit for bit.
constexpr uint64_t kTwoPi_nrad = 6283185307ULL;
inline SpeedScale MakeSpeedScale(uint16_t counts_per_rev) {
  constexpr uint32_t kTurnQ12 = static_cast<uint32_t>(kTwoPi_nrad * kControlRate_Hz * 4096 / 1000000);
  const uint32_t scale_q12 = kTurnQ12 / counts_per_rev;
  const uint32_t rest = kTurnQ12 % counts_per_rev;
  const uint16_t fraction =
      static_cast<uint16_t>((scale_q12 & 0xFFF) << 4 | ((rest << 4) / counts_per_rev));  // 0 to 1
  const int16_t whole = static_cast<int16_t>((scale_q12 >> 12) + (fraction >> 15));
  const int16_t most = static_cast<int16_t>((uint32_t(INT16_MAX) << 12) / (scale_q12 + 1));
  return {whole, static_cast<int16_t>(fraction), most};
}
static_assert(kTwoPi_nrad * kControlRate_Hz / 1000000 / 40 < INT16_MAX,
              "one count of the coarsest encoder must fit the wire's int16");

/// Return the counts of one tick as a speed [mrad/s], clamped to int16.
__attribute__((always_inline)) inline int16_t SpeedFromCounts(const SpeedScale& scale, int16_t counts) {
  int16_t used = counts;
  // One comparison in the usual case: counts + max_counts is negative, and so large, below -max_counts.
  const uint16_t above = static_cast<uint16_t>(counts) + static_cast<uint16_t>(scale.max_counts);
  if (above > static_cast<uint16_t>(scale.max_counts * 2)) {
    used = counts < 0 ? static_cast<int16_t>(-scale.max_counts) : scale.max_counts;
  }
  // Unsigned: the first product alone may exceed int16, and the chip's int has 16 bits.
  const unsigned whole = static_cast<unsigned>(used) * static_cast<unsigned>(scale.whole);
  return static_cast<int16_t>(whole + static_cast<unsigned>(RoundShift16(Product(used, scale.fraction))));
}

// ADC sums: 32 samples of 10 bits, round robin over three channels, 1 ms apart. Together 96 ms, many PWM
// periods.
constexpr uint8_t kAdcSamples = 32;

/// Battery [mV] from an ADC sum: the T'REX reads 1007 at 30 V.
constexpr uint16_t kBatteryQ16 =
    static_cast<uint16_t>((30000UL * 65536 / 1007 + kAdcSamples / 2) / kAdcSamples);
constexpr uint16_t BatteryFromSum_mV(uint16_t sum) {
  return static_cast<uint16_t>((uint32_t(sum) * kBatteryQ16) >> 16);
}
static_assert(BatteryFromSum_mV(1023U * kAdcSamples) > kBoardHigh_mV, "too high a voltage must be readable");

/// Motor current [mA] from an ADC sum. scale: [mA / 512 per count]; zero: reading of no current, as one
/// sample.
inline int16_t CurrentFromSum_mA(uint16_t sum, int16_t scale, int16_t zero) {
  const int16_t above = static_cast<int16_t>(sum - static_cast<uint16_t>(zero) * kAdcSamples);
  return static_cast<int16_t>(Limit((Product(above, scale) + (1L << 13)) >> 14, INT16_MAX));
}

}  // namespace fw
