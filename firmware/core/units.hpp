#pragma once
#include <stdint.h>

#include "core/config.hpp"
#include "core/fixed.hpp"

namespace fw {

/// Factor applied to the counts of a tick before the multiplication, so that the constant fits 16 bits at
/// every rate.
constexpr int16_t kSpeedScale = kControlRate_Hz >= 100 ? 8 : kControlRate_Hz >= 50 ? 4 : 1;

/// Speed of one count per tick [mrad/s], Q8, divided by kSpeedScale. Integer arithmetic, because the chip's
/// double has only 4 bytes: chip and host build agree bit for bit.
constexpr uint64_t kTwoPi_nrad = 6283185307ULL;
constexpr uint64_t kSpeedDivisor = 1000000ULL * kSpeedScale * kCountsPerRev;
constexpr int16_t kSpeedPerCountQ8 =
    static_cast<int16_t>((kTwoPi_nrad * kControlRate_Hz * 256 + kSpeedDivisor / 2) / kSpeedDivisor);
static_assert(kControlRate_Hz != 10 || (kSpeedPerCountQ8 + 128) / 256 == 52,
              "one count in 100 ms is 52.36 mrad/s (thesis, eq. 2.1)");

/// Largest number of counts per tick whose speed fits the wire's int16.
constexpr int16_t kMaxCounts = static_cast<int16_t>(int32_t(32767) * 256 / kSpeedPerCountQ8 / kSpeedScale);

/// Return the counts of one tick as a speed [mrad/s], clamped to int16.
inline int16_t SpeedFromCounts(int16_t counts) {
  const int16_t used = counts > kMaxCounts ? kMaxCounts : counts < -kMaxCounts ? -kMaxCounts : counts;
  const int16_t scaled = static_cast<int16_t>(used * kSpeedScale);
  return RoundShift8(Product(scaled, kSpeedPerCountQ8));
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

/// Motor current [mA] from an ADC sum: 100 mV/A, zero at 511, 5 V over 1024 steps.
constexpr int16_t kCurrentQ15 = static_cast<int16_t>(5000L * 10 * 32768 / 1024 / kAdcSamples / 2);
inline int16_t CurrentFromSum_mA(uint16_t sum) {
  return RoundShift16(Product(static_cast<int16_t>(sum - 511 * kAdcSamples), kCurrentQ15) * 4);
}
static_assert(int64_t(512) * kAdcSamples * kCurrentQ15 * 4 <= INT32_MAX,
              "the intermediate result of a current must fit int32");

}  // namespace fw
