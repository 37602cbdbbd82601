#pragma once
#include <stdint.h>

#include "core/config.hpp"
#include "core/fixed.hpp"

namespace fw {

/// Speed of one count a tick [mrad/s], Q14. In integers, so that chip (4-byte double) and desk agree on every
/// bit.
constexpr uint64_t kTwoPi_nrad = 6283185307ULL;
constexpr int32_t kSpeedPerCountQ14 =
    static_cast<int32_t>((kTwoPi_nrad * kControlRate_Hz * 16384 / kCountsPerRev + 500000) / 1000000);
static_assert(kControlRate_Hz != 10 || (kSpeedPerCountQ14 + 8192) / 16384 == 52,
              "one count in 100 ms is 52.36 mrad/s (thesis, eq. 2.1)");

/// Most counts a tick whose speed still fits the wire's int16.
constexpr int16_t kMaxCounts = static_cast<int16_t>(int64_t(32767) * 16384 / kSpeedPerCountQ14);

/// Counts of one tick as a speed [mrad/s], clamped to int16.
constexpr int16_t SpeedFromCounts(int16_t counts) {
  return static_cast<int16_t>(RoundShift(Limit(counts, kMaxCounts) * kSpeedPerCountQ14, 14));
}

// ADC sums: 32 samples of 10 bits, taken round robin with the two other channels, 1 ms apart: 96 ms, many PWM
// periods.
constexpr uint8_t kAdcSamples = 32;

/// Battery [mV] from a sum: the T'REX reads 1007 at 30 V.
constexpr uint32_t kBatteryQ15 = (30000UL * 32768 / 1007 + kAdcSamples / 2) / kAdcSamples;
constexpr uint16_t BatteryFromSum_mV(uint16_t sum) {
  return static_cast<uint16_t>((sum * kBatteryQ15) >> 15);
}

/// Motor current [mA] from a sum: 100 mV/A, zero at 511, 5 V over 1024 steps.
constexpr int32_t kCurrentQ14 = 5000L * 10 * 16384 / 1024 / kAdcSamples;
constexpr int16_t CurrentFromSum_mA(uint16_t sum) {
  return static_cast<int16_t>(RoundShift((int32_t(sum) - 511L * kAdcSamples) * kCurrentQ14, 14));
}

}  // namespace fw
