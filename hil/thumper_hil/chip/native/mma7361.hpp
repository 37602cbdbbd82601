#pragma once
#include <algorithm>
#include <cmath>

namespace thumper {

/// The T'REX's accelerometer MMA7361L in its range of 1.5 g: analogue outputs at 3.3 V, 1.65 V at rest and
/// 0.8 V per g (data sheet, rev. 0, 2008; typical values, x forward, y left, z up).
///
/// Its filter (400 Hz) is faster than the plant's steps of 1 ms and is left out. So are noise and vibration.
/// The chassis gives way to a collision: the board follows the body's speed with a time constant of 5 ms
/// (assumed).
class Mma7361 {
 public:
  /// Advance by `dt_s` at the body's speed.
  void Step(double speed_m_s, double yaw_rate_rad_s, double dt_s) {
    const double change_m_s = (speed_m_s - speed_m_s_) * (1.0 - std::exp(-dt_s / kChassis_s));
    speed_m_s_ += change_m_s;
    forward_g_ = change_m_s / dt_s / kGravity_m_s2;
    left_g_ = speed_m_s_ * yaw_rate_rad_s / kGravity_m_s2;
  }

  /// pitch: front down, roll: right side down, both from the level.
  void SetAttitude(double pitch_rad, double roll_rad) {
    up_[0] = -std::sin(pitch_rad);
    up_[1] = std::cos(pitch_rad) * std::sin(roll_rad);
    up_[2] = std::cos(pitch_rad) * std::cos(roll_rad);
  }

  /// Return the voltage at an output: 0 is x, 1 is y, 2 is z.
  double Output_V(int axis) const {
    const double motion_g = axis == 0 ? forward_g_ : axis == 1 ? left_g_ : 0.0;
    return std::clamp(kZero_V + kSensitivity_V_g * (up_[axis] + motion_g), kLeast_V, kMost_V);
  }

 private:
  static constexpr double kZero_V = 1.65, kSensitivity_V_g = 0.8;
  static constexpr double kLeast_V = 0.1, kMost_V = 3.2;
  static constexpr double kChassis_s = 0.005;
  static constexpr double kGravity_m_s2 = 9.81;

  double speed_m_s_ = 0.0, forward_g_ = 0.0, left_g_ = 0.0;
  double up_[3] = {0.0, 0.0, 1.0};
};

}  // namespace thumper
