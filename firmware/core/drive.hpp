#pragma once
#include <stdint.h>

#include "core/messages.hpp"
#include "core/wheel.hpp"

namespace fw {

/// What the main loop asks of the control tick.
struct DriveCommand {
  State mode;           ///< CLOSED_LOOP or MANUAL; anything else is motors off
  int16_t left, right;  ///< [mrad/s] in CLOSED_LOOP, [PWM] in MANUAL
};

/// Everything the control tick reads that the main loop writes; copied as a whole, interrupts off.
struct DriveInput {
  DriveCommand command;
  WheelConfig config;
  uint16_t supply_ratio;
};

/// Result of a control tick for one side.
struct SideSample {
  int32_t count;
  WheelSample wheel;
  int16_t integral_pwm_64;
};

/// One side: unwraps the encoder's count and turns command and counts into PWM.
class Side {
 public:
  /// count: the decoder's count, mod 2^16; exact while fewer than 2^15 edges pass in a tick.
  SideSample Step(const DriveInput& input, int16_t value, uint16_t count) {
    const int16_t counts = static_cast<int16_t>(count - static_cast<uint16_t>(count_));
    count_ = static_cast<int32_t>(static_cast<uint32_t>(count_) + static_cast<uint32_t>(int32_t(counts)));
    if (input.command.mode == State::kClosedLoop) {
      const WheelSample wheel = wheel_.Step(input.config, value, counts, input.supply_ratio);
      return {count_, wheel, wheel_.integral_pwm_64()};
    }
    wheel_.Reset();
    const int16_t pwm =
        input.command.mode == State::kManual ? static_cast<int16_t>(Limit(value, kMaxPwm)) : int16_t(0);
    return {count_, {SpeedFromCounts(counts), 0, pwm}, 0};
  }

 private:
  int32_t count_ = 0;
  WheelController wheel_;
};

}  // namespace fw
