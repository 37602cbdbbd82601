#pragma once
#include "core/messages.hpp"

// In place of board/mpu6050.hpp: shows what the gyroscope costs.
class Mpu6050 {
 public:
  static void Start() {}
  bool due() const { return false; }
  void Step(bool) {}
  void AfterMilliseconds(uint8_t, uint8_t) {}
  static void OnDone() {}
  uint16_t heading() const { return 0; }
  fw::GyroscopeState state() const { return fw::GyroscopeState::kOff; }
};
