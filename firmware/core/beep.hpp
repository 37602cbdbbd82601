#pragma once
#include <stdint.h>

namespace fw {

/// Beep pattern: 200 ms of tone, 200 ms of silence. Pauses while the motors are in use.
class BeepPattern {
 public:
  void Start(uint8_t beeps) { remaining_ms_ = static_cast<uint16_t>(beeps * kPeriod_ms); }

  /// Advance the time. Return true while the tone must sound. quiet: wheels stationary and motors off.
  bool Step(uint8_t elapsed_ms, bool quiet) {
    if (!quiet) return false;
    remaining_ms_ = remaining_ms_ > elapsed_ms ? static_cast<uint16_t>(remaining_ms_ - elapsed_ms) : 0;
    return remaining_ms_ % kPeriod_ms >= kPeriod_ms / 2;
  }

 private:
  static constexpr uint16_t kPeriod_ms = 400;
  uint16_t remaining_ms_ = 0;
};

}  // namespace fw
