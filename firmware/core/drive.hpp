#pragma once
#include <stdint.h>

#include "core/messages.hpp"
#include "core/wheel.hpp"

namespace fw {

/// Command from the main loop to the control tick.
struct DriveCommand {
  State mode;           ///< CLOSED_LOOP or MANUAL; any other state: motors off
  int16_t left, right;  ///< [mrad/s] in CLOSED_LOOP, [PWM] in MANUAL; already limited
};

/// Results of a control tick for one side.
struct SideSample {
  int32_t count;
  WheelSample wheel;
};

/// Results of a control tick for both sides, laid out as telemetry sends them.
struct Samples {
  uint32_t time_us;
  SideSample left, right;
  uint16_t lost_edges;  ///< both wheels, mod 2^16
};

/// One side of the robot: unwraps the encoder count and computes the PWM from command and counts.
class Side {
 public:
  /// count: the decoder's count, mod 2^16; exact while fewer than 2^15 edges arrive per tick. reversed: it
  /// falls while the wheel rolls forward. sample: in, the last tick's; out, this tick's. Not inlined, so both
  /// sides share one copy of the code.
  __attribute__((noinline)) void Step(State mode, const WheelConfig& config, int16_t value, uint16_t count,
                                      bool reversed, SideSample* sample) {
    int16_t counts = static_cast<int16_t>(count - decoded_);
    decoded_ = count;
    if (reversed) counts = static_cast<int16_t>(-static_cast<uint16_t>(counts));
    sample->count =
        static_cast<int32_t>(static_cast<uint32_t>(sample->count) + static_cast<uint32_t>(int32_t(counts)));
    const int16_t speed = SpeedFromCounts(config.speed, counts);
    if (mode == State::kClosedLoop) {
      controller_.Step(config, value, speed, &sample->wheel);
      return;
    }
    controller_.TrackSpeed(speed);
    sample->wheel = {speed, 0, mode == State::kManual ? value : int16_t(0), 0};
  }

 private:
  WheelController controller_;
  uint16_t decoded_ = 0;  // the decoder's count at the last tick
};

}  // namespace fw
