#pragma once
#include <stdint.h>

namespace fw {

/// The rhythm of the beeps: 200 ms of tone, 200 ms of pause. Waits while the motors are not to be used.
class BeepPattern {
 public:
  void Start(uint8_t beeps) { remaining_ms_ = static_cast<uint16_t>(beeps * kPeriod_ms); }

  /// Let time pass; true while the tone is to sound. quiet: the wheels stand and the motors are off.
  bool Step(uint8_t elapsed_ms, bool quiet) {
    if (!quiet || remaining_ms_ == 0) return false;
    remaining_ms_ = remaining_ms_ > elapsed_ms ? static_cast<uint16_t>(remaining_ms_ - elapsed_ms) : 0;
    return remaining_ms_ % kPeriod_ms >= kPeriod_ms / 2;
  }

 private:
  static constexpr uint16_t kPeriod_ms = 400;
  uint16_t remaining_ms_ = 0;
};

}  // namespace fw
