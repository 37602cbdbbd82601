#pragma once
#include <stdint.h>

/// Control rate [Hz]. The default is 10, as in the thesis. 20, 50 and 100 also work (make RATE=50).
#ifndef THUMPER_CONTROL_RATE_HZ
#define THUMPER_CONTROL_RATE_HZ 10
#endif

namespace fw {

constexpr uint8_t kVersionMajor = 0, kVersionMinor = 2, kVersionPatch = 0;

constexpr uint8_t kControlRate_Hz = THUMPER_CONTROL_RATE_HZ;
static_assert(kControlRate_Hz == 10 || kControlRate_Hz == 20 || kControlRate_Hz == 50 ||
                  kControlRate_Hz == 100,
              "the control loop is verified at 10, 20, 50 and 100 Hz only");
constexpr uint32_t kTick_us = 1000000UL / kControlRate_Hz;

constexpr int16_t kMaxSpeed_mrad_s = 17000;
constexpr int16_t kSlow_mrad_s = 700;     // scrub may hold a wheel with a lower set-point
constexpr int16_t kBraked_mrad_s = 2000;  // a braked wheel keeps its speed this well
constexpr int16_t kMaxPwm = 255;
constexpr uint16_t kLinkTimeout_ms = 300;
constexpr uint8_t kFaultWindow_ticks = 3 * kControlRate_Hz / 10;  // 300 ms

constexpr uint16_t kCellNominal_mV = 3700;  // the feed-forward gains apply at this voltage
constexpr uint16_t kCellHigh_mV = 4500;     // full: 4200
// The T'REX allows 30 V, and its divider reads up to 30.5 V: seven cells at 4.5 V would be 31.5 V.
constexpr uint16_t kBoardHigh_mV = 30000;
constexpr uint8_t kLowBatteryBeeps = 5;

}  // namespace fw
