#pragma once
#include <cstddef>

namespace thumper {

// robot_params.py fills these from wild_thumper.toml in this order. Every field is a double.

struct MotorParams {        // one motor, at the output of its gearbox
  double motors_per_side;   // driven in parallel by one bridge
  double resistance_Ohm;    // winding, with its share of bridge and wiring
  double torque_Nm_A;       // Kt: smaller than Kf by the gearbox losses
  double back_emf_V_s_rad;  // Kf
  double inertia_kg_m2;     // rotor, gear and wheel, without the body
  double viscous_Nm_s_rad;
  double coulomb_Nm;
  double static_ratio;  // break-away torque over sliding friction
  double noise_Nm;      // torque noise, standard deviation
  double noise_time_s;
  double spread_ratio;       // standard deviation of Kt and friction between the sides
  double unit_spread_ratio;  // standard deviation of Kt and friction between robots
};

struct BatteryParams {
  double capacity_Ah;
  double resistance_Ohm;
  double state_of_charge;     // at start, 0...1
  double idle_current_A;      // current of the board
  double open_circuit_V[11];  // at 0, 10, ... 100 % charge
};

struct BodyParams {
  double mass_kg;
  double yaw_inertia_kg_m2;
  double wheel_radius_m;
  double radius_spread_ratio;
  double track_m;             // effective track for turning
  double track_growth_s;      // relative growth of the track per rad/s of yaw
  double track_spread_ratio;  // standard deviation of the track between robots
  double track_noise_ratio;   // slow variation of the slip, standard deviation
  double track_noise_time_s;
  double centre_offset_m;   // standard deviation between robots of the centre of rotation, along x
  double centre_wander_m;   // standard deviation of its slow motion
  double centre_time_s;     // correlation time of that motion
  double scrub_Nm;          // moment about the vertical from sideways-scrubbing tyres
  double traction_Nm;       // friction torque of each side's wheels when they slip against an obstacle
  double scrub_slip_rad_s;  // yaw rate at which the scrub moment is fully developed
};

struct EncoderParams {
  double counts_per_rev;
  double edge_error_counts;  // standard deviation of each magnet edge's position
};

struct BoardParams {
  double pwm_low_coasts;  // 1: a bridge whose PWM stays low is open; 0: it shorts the winding
  double battery_V_per_count;
  double current_A_per_count;
  double current_zero_counts;
  double clock_drift;  // relative error of the chip's clock; positive runs fast
};

struct PlantParams {
  MotorParams motor;
  BatteryParams battery;
  BodyParams body;
  EncoderParams encoder;
  BoardParams board;
};

constexpr std::size_t kPlantParamCount = sizeof(PlantParams) / sizeof(double);

}  // namespace thumper
