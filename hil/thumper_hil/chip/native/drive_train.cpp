#include "drive_train.hpp"

#include <algorithm>
#include <cmath>

namespace thumper {

DriveTrain::DriveTrain(const PlantParams& params, uint64_t seed)
    : params_(params),
      random_(seed),
      battery_(params.battery),
      torque_noise_{{params.motor.noise_Nm, params.motor.noise_time_s},
                    {params.motor.noise_Nm, params.motor.noise_time_s}},
      track_noise_(params.body.track_noise_ratio, params.body.track_noise_time_s),
      centre_random_(seed ^ 0xCE47E4),
      centre_noise_(params.body.centre_wander_m, params.body.centre_time_s),
      track_m_(params.body.track_m) {
  for (int side = 0; side < 2; ++side) {
    torque_ratio_[side] = 1.0 + params.motor.spread_ratio * random_.Normal();
    friction_ratio_[side] = 1.0 + params.motor.spread_ratio * random_.Normal();
    radius_m_[side] = params.body.wheel_radius_m * (1.0 + params.body.radius_spread_ratio * random_.Normal());
  }
  // Variation between robots. It has its own generator so that it does not change the noise.
  Random unit(seed ^ 0x51573E5);
  const double torque_unit = 1.0 + params.motor.unit_spread_ratio * unit.Normal();
  const double friction_unit = 1.0 + params.motor.unit_spread_ratio * unit.Normal();
  for (int side = 0; side < 2; ++side) {
    torque_ratio_[side] *= torque_unit;
    friction_ratio_[side] *= friction_unit;
  }
  params_.body.track_m *= 1.0 + params.body.track_spread_ratio * unit.Normal();
  track_m_ = params_.body.track_m;
  centre_m_ = params_.body.centre_offset_m * unit.Normal();
}

void DriveTrain::Step(const BridgeCommand (&command)[2], double dt_s) {
  const MotorParams& motor = params_.motor;
  const double n = motor.motors_per_side;
  double torque_Nm[2], damping[2];             // torque at the current speed, and minus its derivative
  double conductance_S = 0.0, source_A = 0.0;  // load of both bridges on the battery
  for (int side = 0; side < 2; ++side) {
    const BridgeCommand& bridge = command[side];
    if (bridge.brake) continue;
    const double signed_duty = Forward(side, bridge) ? bridge.duty : -bridge.duty;
    const double per_Ohm = n * faults_[side].connected * signed_duty / motor.resistance_Ohm;
    conductance_S += per_Ohm * signed_duty;
    source_A -= per_Ohm * motor.back_emf_V_s_rad * state_.wheel_rad_s[side];
    // A short stores no energy: it loads the battery for the duty's share of the time, without delay.
    if (faults_[side].shorted) conductance_S += bridge.duty / kShort_Ohm;
  }
  battery_.Load(conductance_S, source_A);
  for (int side = 0; side < 2; ++side) {
    const BridgeCommand& bridge = command[side];
    const double sign = Forward(side, bridge) ? 1.0 : -1.0;
    const double w = state_.wheel_rad_s[side];
    const double Kt = motor.torque_Nm_A * torque_ratio_[side];
    // Driving: the mean voltage is duty * battery, with the winding always connected. Braking: the winding is
    // shorted for the duty's share of the time and open for the rest.
    const double share = faults_[side].connected * (bridge.brake ? bridge.duty : 1.0);
    const double source_V = bridge.brake ? 0.0 : sign * bridge.duty * battery_.voltage_V();
    const double current_A = share * (source_V - motor.back_emf_V_s_rad * w) / motor.resistance_Ohm;
    torque_Nm[side] = n * (Kt * current_A - motor.viscous_Nm_s_rad * w);
    damping[side] = n * (share * Kt * motor.back_emf_V_s_rad / motor.resistance_Ohm + motor.viscous_Nm_s_rad);
    if (w != 0.0) torque_Nm[side] += n * torque_noise_[side].Step(random_, dt_s);
    state_.current_A[side] = n * current_A + (faults_[side].shorted ? source_V / kShort_Ohm : 0.0);
    if (faults_[side].reversed) state_.current_A[side] *= -1.0;  // as the bridge measures it
  }
  battery_.Step(conductance_S * battery_.voltage_V() + source_A, dt_s);
  const bool wheels_in_air = params_.body.traction_Nm <= 0.0;
  // Weight that rolls acts on the wheels; weight that leans on an obstacle does not.
  double rolling_Nm[2] = {torque_Nm[0] - gravity_Nm_, torque_Nm[1] - gravity_Nm_};
  body_moves_ = !wheels_in_air && !(held_ && PushesIntoObstacle(rolling_Nm));
  const double before_rad_s[2] = {state_.wheel_rad_s[0], state_.wheel_rad_s[1]};
  MoveWheels(body_moves_ ? rolling_Nm : torque_Nm, damping, dt_s);
  double turn_rad[2];
  for (int side = 0; side < 2; ++side) {
    turn_rad[side] = 0.5 * (before_rad_s[side] + state_.wheel_rad_s[side]) * dt_s;
    state_.wheel_rad[side] += turn_rad[side];
  }
  speed_m_s_ = 0.0;
  if (body_moves_) MoveBody(turn_rad, dt_s);
}

bool DriveTrain::Forward(int side, const BridgeCommand& bridge) const {
  return bridge.forward != faults_[side].reversed;
}

void DriveTrain::MoveWheels(const double (&torque_Nm)[2], const double (&damping)[2], double dt_s) {
  const BodyParams& body = params_.body;
  const MotorParams& motor = params_.motor;
  const double r = body.wheel_radius_m;
  // Mass matrix [[own, across], [across, own]] of the wheels, the body's mass and its yaw inertia.
  const double straight = body_moves_ ? 0.25 * body.mass_kg * r * r : 0.0;
  const double turning = body_moves_ ? body.yaw_inertia_kg_m2 * r * r / (track_m_ * track_m_) : 0.0;
  const double own = motor.motors_per_side * motor.inertia_kg_m2 + straight + turning;
  const double across = straight - turning;
  // Half of the damping uses the new speed (Crank-Nicolson): stable, and second order in time.
  const double m0 = own + 0.5 * damping[0] * dt_s, m1 = own + 0.5 * damping[1] * dt_s;
  const double determinant = m0 * m1 - across * across;
  const double inverse[2][2] = {{m1 / determinant, -across / determinant},
                                {-across / determinant, m0 / determinant}};
  double(&w)[2] = state_.wheel_rad_s;
  const double start[2] = {w[0], w[1]};
  for (int side = 0; side < 2; ++side)
    w[side] += (inverse[side][0] * torque_Nm[0] + inverse[side][1] * torque_Nm[1]) * dt_s;

  // Friction: three bounded impulses, each opposing its own relative motion.
  double bound[3], impulse[3] = {0.0, 0.0, 0.0};
  for (int side = 0; side < 2; ++side) {
    const double stick = start[side] == 0.0 ? motor.static_ratio : 1.0;
    const double slip_Nm = body_moves_ ? 0.0 : body.traction_Nm;
    const double friction_Nm = motor.coulomb_Nm * friction_ratio_[side] * faults_[side].friction;
    bound[side] = (motor.motors_per_side * friction_Nm * stick + slip_Nm) * dt_s;
    constexpr double kJam_Nm = 1e4;  // more than any torque in this model
    if (faults_[side].blocked) bound[side] = kJam_Nm * dt_s;
  }
  const double yaw_per_rad_s = r / track_m_;  // yaw rate per (right - left)
  bound[2] = body_moves_ ? body.scrub_Nm * yaw_per_rad_s * dt_s : 0.0;
  const double yaw_inverse = inverse[0][0] + inverse[1][1] - 2.0 * inverse[0][1];
  // The scrub moment builds up over a small slip: a soft constraint.
  const double yaw_softness = bound[2] > 0.0 ? body.scrub_slip_rad_s / (yaw_per_rad_s * bound[2]) : 0.0;
  constexpr int kSweeps = 8;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (int side = 0; side < 2; ++side) {
      const double wanted = impulse[side] - w[side] / inverse[side][side];
      const double change = std::clamp(wanted, -bound[side], bound[side]) - impulse[side];
      impulse[side] += change;
      w[0] += inverse[0][side] * change;
      w[1] += inverse[1][side] * change;
    }
    if (bound[2] > 0.0) {
      const double slip = w[1] - w[0] + yaw_softness * impulse[2];
      const double wanted = impulse[2] - slip / (yaw_inverse + yaw_softness);
      const double change = std::clamp(wanted, -bound[2], bound[2]) - impulse[2];
      impulse[2] += change;
      w[0] += (inverse[0][1] - inverse[0][0]) * change;
      w[1] += (inverse[1][1] - inverse[1][0]) * change;
    }
  }
  constexpr double kStill_rad_s = 1e-6;  // residual speed of a full stop after the sweeps
  for (int side = 0; side < 2; ++side)
    if (std::abs(w[side]) < kStill_rad_s && std::abs(impulse[side]) < bound[side]) w[side] = 0.0;
}

void DriveTrain::MoveBody(const double (&wheel_turn_rad)[2], double dt_s) {
  const BodyParams& body = params_.body;
  const double rolled_rad_s = std::abs(wheel_turn_rad[1] - wheel_turn_rad[0]) / dt_s;
  const double yaw_rad_s = rolled_rad_s * body.wheel_radius_m / body.track_m;  // without the growth
  track_m_ = body.track_m * (1.0 + body.track_growth_s * yaw_rad_s + track_noise_.Step(random_, dt_s));
  const double left_m = (1.0 - faults_[0].slip) * radius_m_[0] * wheel_turn_rad[0];
  const double right_m = (1.0 - faults_[1].slip) * radius_m_[1] * wheel_turn_rad[1];
  const double turn_rad = (right_m - left_m) / track_m_;
  const double heading_rad = state_.yaw_rad + 0.5 * turn_rad;
  const double distance_m = 0.5 * (left_m + right_m);
  speed_m_s_ = distance_m / dt_s;
  // A turn about a point in front of the origin moves the origin sideways.
  const double centre_m = centre_m_ + centre_noise_.Step(centre_random_, dt_s);
  const double sideways_m = -centre_m * turn_rad;
  state_.x_m += distance_m * std::cos(heading_rad) - sideways_m * std::sin(heading_rad);
  state_.y_m += distance_m * std::sin(heading_rad) + sideways_m * std::cos(heading_rad);
  state_.yaw_rad = std::remainder(state_.yaw_rad + turn_rad, 2.0 * M_PI);
}

bool DriveTrain::PushesIntoObstacle(const double (&torque_Nm)[2]) const {
  // Desired motion of the wheels: their speed or, once stalled, the direction of the motor torque.
  constexpr double kSpeedPerTorque = 10.0;
  double desired[2];
  for (int side = 0; side < 2; ++side)
    desired[side] = state_.wheel_rad_s[side] + kSpeedPerTorque * torque_Nm[side];
  const double half_track_m = 0.5 * track_m_;
  return held_v_m_s_ * (desired[0] + desired[1]) + half_track_m * held_w_rad_s_ * (desired[1] - desired[0]) >
         0.0;
}

void DriveTrain::Place(double x_m, double y_m, double yaw_rad) {
  state_.x_m = x_m;
  state_.y_m = y_m;
  state_.yaw_rad = yaw_rad;
}

void DriveTrain::SetClimb(double climb_rad) {
  constexpr double kGravity_m_s2 = 9.81;
  const double force_N = params_.body.mass_kg * kGravity_m_s2 * std::sin(climb_rad);
  gravity_Nm_ = 0.5 * params_.body.wheel_radius_m * force_N;
}

void DriveTrain::Hold(double v_m_s, double w_rad_s) {
  held_ = true;
  held_v_m_s_ = v_m_s;
  held_w_rad_s_ = w_rad_s;
}

}  // namespace thumper
