#pragma once
#include <algorithm>

#include "params.hpp"

namespace thumper {

/// Battery model: open-circuit voltage by state of charge, and one internal resistance.
class Battery {
 public:
  explicit Battery(const BatteryParams& params) : params_(params), charge_(params.state_of_charge) {
    Step(0.0, 0.0);
  }

  /// Draw `motor_current_A` (plus the board's own current) for `dt_s`.
  void Step(double motor_current_A, double dt_s) {
    const double current_A = motor_current_A + params_.idle_current_A;
    charge_ = std::clamp(charge_ - current_A * dt_s / (3600.0 * params_.capacity_Ah), 0.0, 1.0);
    voltage_V_ = OpenCircuit_V() - params_.resistance_Ohm * current_A;
  }

  void SetCharge(double charge) { charge_ = charge; }
  void SetResistance(double resistance_Ohm) { params_.resistance_Ohm = resistance_Ohm; }

  /// Compute the terminal voltage under a load that draws `conductance_S * voltage + source_A`. Solved in
  /// closed form, because a step-by-step loop would be stiff with an old battery's large resistance.
  void Load(double conductance_S, double source_A) {
    voltage_V_ = (OpenCircuit_V() - params_.resistance_Ohm * (source_A + params_.idle_current_A)) /
                 (1.0 + params_.resistance_Ohm * conductance_S);
  }

  double voltage_V() const { return voltage_V_; }  ///< at the terminals
  double charge() const { return charge_; }        ///< 0...1

 private:
  double OpenCircuit_V() const {
    constexpr int kLast = 10;
    const double position = charge_ * kLast;
    const int below = std::min(static_cast<int>(position), kLast - 1);
    const double* table = params_.open_circuit_V;
    return table[below] + (position - below) * (table[below + 1] - table[below]);
  }

  BatteryParams params_;
  double charge_;
  double voltage_V_ = 0.0;
};

}  // namespace thumper
