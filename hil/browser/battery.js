// The battery: open-circuit voltage by charge, behind one resistance. As hil/thumper_hil/chip/native/battery.hpp.

export class Battery {
  constructor(params) {
    this.params = params;
    this.charge = params.state_of_charge;  // 0...1
    this.step(0, 0);
  }

  openCircuit_V() {
    const table = this.params.open_circuit_V;
    const position = this.charge * (table.length - 1);
    const below = Math.min(Math.floor(position), table.length - 2);
    return table[below] + (position - below) * (table[below + 1] - table[below]);
  }

  /** Compute the terminal voltage under a load that draws `conductance_S * voltage + source_A`. */
  load(conductance_S, source_A) {
    const { resistance_Ohm, idle_current_A } = this.params;
    this.voltage_V =
      (this.openCircuit_V() - resistance_Ohm * (source_A + idle_current_A)) / (1 + resistance_Ohm * conductance_S);
  }

  /** Draw a motor current, and the board's own, for `dt_s`. */
  step(motor_A, dt_s) {
    const current_A = motor_A + this.params.idle_current_A;
    const used = (current_A * dt_s) / (3600 * this.params.capacity_Ah);
    this.charge = Math.min(Math.max(this.charge - used, 0), 1);
    this.voltage_V = this.openCircuit_V() - this.params.resistance_Ohm * current_A;
  }
}
