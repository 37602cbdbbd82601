#pragma once
#include <stdint.h>

#include "core/messages.hpp"
#include "core/wheel.hpp"

namespace fw {

/// What the main loop asks of the control tick.
struct DriveCommand {
  State mode;           ///< CLOSED_LOOP or MANUAL; anything else is motors off
  int16_t left, right;  ///< [mrad/s] in CLOSED_LOOP, [PWM] in MANUAL; within their limits
};

/// What a control tick leaves behind for one side.
struct SideSample {
  int32_t count;
  WheelSample wheel;
};

/// Likewise for the robot; as telemetry sends it.
struct Samples {
  uint32_t time_us;
  SideSample left, right;
  uint16_t lost_edges;  ///< of both wheels, mod 2^16
};

/// One side: unwraps the encoder's count and turns command and counts into PWM.
class Side {
 public:
  /// count: the decoder's count, mod 2^16; exact while fewer than 2^15 edges pass in a tick. sample: of the
  /// last tick, then of this one. Not inlined: one copy of it serves both sides.
  __attribute__((noinline)) void Step(State mode, const WheelConfig& config, int16_t value, uint16_t count,
                                      SideSample* sample) {
    const int16_t counts = static_cast<int16_t>(count - static_cast<uint16_t>(sample->count));
    sample->count =
        static_cast<int32_t>(static_cast<uint32_t>(sample->count) + static_cast<uint32_t>(int32_t(counts)));
    if (mode == State::kClosedLoop) {
      controller_.Step(config, value, counts, &sample->wheel);
      return;
    }
    const int16_t speed = SpeedFromCounts(counts);
    controller_.TrackSpeed(speed);
    sample->wheel = {speed, 0, mode == State::kManual ? value : int16_t(0), 0};
  }

 private:
  WheelController controller_;
};

}  // namespace fw
