// Motors, wheels and body of a skid-steered robot. The equations are those of
// hil/thumper_hil/chip/native/drive_train.cpp, for an average robot: no noise, no spread between its parts.
import { Battery } from "./battery.js";

const SWEEPS = 8;
const STILL_RAD_S = 1e-6;
const JAM_NM = 1e4;  // more than any torque here
const SPEED_PER_TORQUE = 10;

const clamp = (value, most) => Math.min(Math.max(value, -most), most);
/** Return an angle in (-pi, pi]. */
export const wrap = (angle_rad) => angle_rad - 2 * Math.PI * Math.round(angle_rad / (2 * Math.PI));

export class DriveTrain {
  /** `params`: the tables of wild_thumper.toml. */
  constructor(params) {
    this.params = params;
    this.battery = new Battery(params.battery);
    this.pose = { x_m: 0, y_m: 0, yaw_rad: 0 };
    this.wheel_rad = [0, 0];  // left, right
    this.wheel_rad_s = [0, 0];
    this.current_A = [0, 0];
    this.blocked = [false, false];
    this.track_m = params.body.track_m;
    this.held = null;  // direction of a contact, {v_m_s, w_rad_s}
    this.slips = false;  // the wheels turn, and a contact holds the body
  }

  /** Advance by `dt_s`, a few milliseconds at most, with constant bridge commands. */
  step(commands, dt_s) {
    const { motor } = this.params;
    const n = motor.motors_per_side;
    let conductance_S = 0, source_A = 0;  // load of both bridges on the battery
    commands.forEach((bridge, side) => {
      if (bridge.brake) return;
      const duty = bridge.forward ? bridge.duty : -bridge.duty;
      conductance_S += (n * duty * duty) / motor.resistance_Ohm;
      source_A -= (n * duty * motor.back_emf_V_s_rad * this.wheel_rad_s[side]) / motor.resistance_Ohm;
    });
    this.battery.load(conductance_S, source_A);
    const torque_Nm = [0, 0], damping = [0, 0];
    commands.forEach((bridge, side) => {
      const speed_rad_s = this.wheel_rad_s[side];
      const share = bridge.brake ? bridge.duty : 1;
      const source_V = bridge.brake ? 0 : (bridge.forward ? 1 : -1) * bridge.duty * this.battery.voltage_V;
      const current_A = (share * (source_V - motor.back_emf_V_s_rad * speed_rad_s)) / motor.resistance_Ohm;
      torque_Nm[side] = n * (motor.torque_Nm_A * current_A - motor.viscous_Nm_s_rad * speed_rad_s);
      damping[side] =
        n * ((share * motor.torque_Nm_A * motor.back_emf_V_s_rad) / motor.resistance_Ohm + motor.viscous_Nm_s_rad);
      this.current_A[side] = n * current_A;
    });
    this.battery.step(conductance_S * this.battery.voltage_V + source_A, dt_s);
    const moves = !(this.held && this.pushesIntoContact(torque_Nm));
    const before = [...this.wheel_rad_s];
    this.moveWheels(torque_Nm, damping, moves, dt_s);
    this.slips = !moves && this.wheel_rad_s.some((speed) => speed !== 0);
    const turned = before.map((speed, side) => 0.5 * (speed + this.wheel_rad_s[side]) * dt_s);
    turned.forEach((angle_rad, side) => (this.wheel_rad[side] += angle_rad));
    if (moves) this.moveBody(turned, dt_s);
  }

  moveWheels(torque_Nm, damping, moves, dt_s) {
    const { body, motor } = this.params;
    const r = body.wheel_radius_m;
    const straight = moves ? 0.25 * body.mass_kg * r * r : 0;
    const turning = moves ? (body.yaw_inertia_kg_m2 * r * r) / (this.track_m * this.track_m) : 0;
    const own = motor.motors_per_side * motor.inertia_kg_m2 + straight + turning;
    const across = straight - turning;
    // Half of the damping acts at the new speed (Crank-Nicolson).
    const m0 = own + 0.5 * damping[0] * dt_s, m1 = own + 0.5 * damping[1] * dt_s;
    const determinant = m0 * m1 - across * across;
    const inverse = [[m1 / determinant, -across / determinant], [-across / determinant, m0 / determinant]];
    const start = [...this.wheel_rad_s];
    const w = this.wheel_rad_s;
    for (const side of [0, 1]) w[side] += (inverse[side][0] * torque_Nm[0] + inverse[side][1] * torque_Nm[1]) * dt_s;
    this.applyFriction(start, inverse, moves, dt_s);
  }

  /** Three bounded impulses: the friction of each side and the moment of the scrubbing tyres. */
  applyFriction(start, inverse, moves, dt_s) {
    const { body, motor } = this.params;
    const w = this.wheel_rad_s;
    const impulse = [0, 0, 0];
    const bound = start.map((speed, side) => {
      if (this.blocked[side]) return JAM_NM * dt_s;
      const stick = speed === 0 ? motor.static_ratio : 1;
      return (motor.motors_per_side * motor.coulomb_Nm * stick + (moves ? 0 : body.traction_Nm)) * dt_s;
    });
    const yaw_per_rad_s = body.wheel_radius_m / this.track_m;
    bound.push(moves ? body.scrub_Nm * yaw_per_rad_s * dt_s : 0);
    const yaw_inverse = inverse[0][0] + inverse[1][1] - 2 * inverse[0][1];
    const softness = bound[2] > 0 ? body.scrub_slip_rad_s / (yaw_per_rad_s * bound[2]) : 0;
    for (let sweep = 0; sweep < SWEEPS; ++sweep) {
      for (const side of [0, 1]) {
        const change = clamp(impulse[side] - w[side] / inverse[side][side], bound[side]) - impulse[side];
        impulse[side] += change;
        w[0] += inverse[0][side] * change;
        w[1] += inverse[1][side] * change;
      }
      if (bound[2] === 0) continue;
      const slip = w[1] - w[0] + softness * impulse[2];
      const change = clamp(impulse[2] - slip / (yaw_inverse + softness), bound[2]) - impulse[2];
      impulse[2] += change;
      w[0] += (inverse[0][1] - inverse[0][0]) * change;
      w[1] += (inverse[1][1] - inverse[1][0]) * change;
    }
    for (const side of [0, 1])
      if (Math.abs(w[side]) < STILL_RAD_S && Math.abs(impulse[side]) < bound[side]) w[side] = 0;
  }

  moveBody(turned_rad, dt_s) {
    const { body } = this.params;
    const r = body.wheel_radius_m;
    const yaw_rad_s = ((Math.abs(turned_rad[1] - turned_rad[0]) / dt_s) * r) / body.track_m;
    this.track_m = body.track_m * (1 + body.track_growth_s * yaw_rad_s);
    const turn_rad = (r * (turned_rad[1] - turned_rad[0])) / this.track_m;
    const heading_rad = this.pose.yaw_rad + 0.5 * turn_rad;
    const distance_m = 0.5 * r * (turned_rad[0] + turned_rad[1]);
    this.pose = {
      x_m: this.pose.x_m + distance_m * Math.cos(heading_rad),
      y_m: this.pose.y_m + distance_m * Math.sin(heading_rad),
      yaw_rad: wrap(this.pose.yaw_rad + turn_rad),
    };
  }

  pushesIntoContact(torque_Nm) {
    const wanted = this.wheel_rad_s.map((speed, side) => speed + SPEED_PER_TORQUE * torque_Nm[side]);
    const { v_m_s, w_rad_s } = this.held;
    return v_m_s * (wanted[0] + wanted[1]) + 0.5 * this.track_m * w_rad_s * (wanted[1] - wanted[0]) > 0;
  }
}
