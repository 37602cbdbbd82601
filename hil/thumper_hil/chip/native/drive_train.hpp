#pragma once
#include "battery.hpp"
#include "bridge.hpp"
#include "faults.hpp"
#include "params.hpp"
#include "random.hpp"

namespace thumper {

/// Pose and motion of the robot. Positions are in the world frame; yaw is counter-clockwise.
struct RobotState {
  double x_m = 0.0, y_m = 0.0, yaw_rad = 0.0;
  double wheel_rad[2] = {0.0, 0.0};  // travel of the left and right wheels since the start
  double wheel_rad_s[2] = {0.0, 0.0};
  double current_A[2] = {0.0, 0.0};  // of each bridge, averaged over a PWM period
};

/// Motors, wheels and body of a skid-steered robot. They are stepped together because the body couples the
/// sides.
///
/// Each side: `J dw/dt = n (Kt i - B w) - friction`, `i = (u - Kf w) / R` (inductance neglected: L/R < 1 ms).
/// The body adds its mass to the mean of the wheel speeds and its yaw inertia to their difference. The
/// electrical damping is integrated half implicitly. Coulomb friction of both sides and the tyres' scrub
/// moment are bounded impulses (projected Gauss-Seidel), so the robot comes to a true standstill inside the
/// dead band.
class DriveTrain {
 public:
  DriveTrain(const PlantParams& params, uint64_t seed);

  /// Advance by `dt_s` (a few ms at most) with constant bridge commands at the battery's current voltage.
  void Step(const BridgeCommand (&command)[2], double dt_s);

  void Place(double x_m, double y_m, double yaw_rad);

  /// Contact of the footprint: block body motion along (v, w) [m/s, rad/s] from now until `Release`.
  void Hold(double v_m_s, double w_rad_s);
  void Release() { held_ = false; }

  /// Put the body on a slope that climbs by this angle along its heading; gravity pulls it back down.
  void SetClimb(double climb_rad);

  void SetFaults(int side, const SideFaults& faults) { faults_[side] = faults; }
  Battery& battery() { return battery_; }

  const RobotState& state() const { return state_; }
  double speed_m_s() const { return speed_m_s_; }  ///< of the body, forward, in the last step
  const Battery& battery() const { return battery_; }

 private:
  bool Forward(int side, const BridgeCommand& bridge) const;
  bool PushesIntoObstacle(const double (&torque_Nm)[2]) const;
  void MoveWheels(const double (&torque_Nm)[2], const double (&damping)[2], double dt_s);
  void MoveBody(const double (&wheel_turn_rad)[2], double dt_s);

  PlantParams params_;
  Random random_;
  Battery battery_;
  CorrelatedNoise torque_noise_[2];
  CorrelatedNoise track_noise_;
  Random centre_random_;  // its own generator, so that it does not change the other noise
  CorrelatedNoise centre_noise_;
  double torque_ratio_[2], friction_ratio_[2], radius_m_[2];
  double track_m_;
  double centre_m_ = 0.0;  // the robot turns about this point of its x axis
  RobotState state_;
  SideFaults faults_[2];
  double speed_m_s_ = 0.0;
  double gravity_Nm_ = 0.0;  // against each side's wheels, on a slope
  bool held_ = false, body_moves_ = true;
  double held_v_m_s_ = 0.0, held_w_rad_s_ = 0.0;
};

}  // namespace thumper
