// The whole: a robot with its firmware in a flat, a lidar on it, and the host's side of the cable. No page in here.
import { BoardLink } from "./board_link.js";
import { Contact } from "./contact.js";
import { Lidar } from "./lidar.js";
import { Odometry } from "./odometry.js";
import { Protocol } from "./protocol.js";
import { Robot } from "./robot.js";
import { START } from "./room.js";
import { Wanderer } from "./wanderer.js";

const CONTACT_MS = 5;
const HISTORY = 150;  // telemetry messages, 15 s
const STILL = { v_m_s: 0, w_rad_s: 0 };

export class Simulation {
  /** `hex`: firmware; `params`: the robot; `schema`: the protocol. */
  constructor({ hex, params, schema }) {
    this.protocol = new Protocol(schema);
    this.robot = new Robot({ hex, params, onByte: (byte) => this.link.onByte(byte) });
    this.robot.drive.pose = START;
    this.contact = new Contact(this.robot.drive, params.outline);
    this.lidar = new Lidar();
    this.wanderer = new Wanderer(this.lidar);
    this.odometry = new Odometry(params, START);
    this.link = new BoardLink(this.protocol, {
      send: (bytes) => this.robot.send(bytes),
      onMessage: (name, fields) => this.onMessage(name, fields),
    });
    this.twist = null;  // wanted by the driver; null lets the robot wander
    this.history = [];  // telemetry with names of state and fault, oldest first
    this.ms = 0;
    this.slipped_at_ms = -Infinity;  // the newest contact in which the wheels slipped
    this.slipped_backwards = false;
    this.unplugged_off_at_ms = -Infinity;  // the cable was pulled while the motors were off
    this.plug_in_at_ms = null;
    this.repaired = false;  // a fault is to be cleared
  }

  get newest() {
    return this.history.at(-1);
  }

  get pose() {
    return this.robot.drive.pose;
  }

  /** Whether a fault stopped the robot and nobody has driven it since. */
  get waits() {
    return this.twist === STILL;
  }

  /** Advance by one millisecond; return the lidar's new points. */
  step() {
    this.robot.step();
    if (++this.ms === this.plug_in_at_ms) this.link.plugged = true;
    const { slips, held } = this.robot.drive;
    if (slips) {
      this.slipped_at_ms = this.ms;
      this.slipped_backwards = held.v_m_s < 0;
    }
    if (this.ms % CONTACT_MS === 0) this.contact.check(CONTACT_MS / 1000);
    return this.lidar.advance(this.robot.time_s, this.pose);
  }

  /** As the robot's one loop does: each telemetry message starts a control cycle. */
  onMessage(name, fields) {
    if (name !== "telemetry") return;
    const state = this.protocol.name("State", fields.state), fault = this.protocol.name("Fault", fields.fault);
    this.history.push({ ...fields, state, fault });
    this.history.splice(0, this.history.length - HISTORY);
    this.odometry.update(fields.left_count, fields.right_count);
    if (fault !== "NONE") {
      this.twist = STILL;  // after a fault the robot waits for its driver
      if (this.repaired) this.link.command("CLEAR_FAULT");  // the board refuses until its filtered readings are good
    } else this.repaired = false;
    const wanted = this.twist ?? this.wanderer.twist();
    if (state === "DISARMED" && wanted.v_m_s * wanted.v_m_s + wanted.w_rad_s * wanted.w_rad_s > 0) this.link.command("ARM");
    if (state === "CLOSED_LOOP") this.link.setWheelSpeeds(this.wheelSpeeds(wanted));
  }

  wheelSpeeds({ v_m_s, w_rad_s }) {
    const { wheel_radius_m, track_m } = this.robot.params.body;
    return [v_m_s - 0.5 * track_m * w_rad_s, v_m_s + 0.5 * track_m * w_rad_s].map((speed) => speed / wheel_radius_m);
  }

  /** Pull the cable to the board for a while. */
  unplug(ms) {
    this.link.plugged = false;
    if (this.newest?.state === "DISARMED") this.unplugged_off_at_ms = this.ms;
    this.plug_in_at_ms = this.ms + ms;
  }

  /** Repair all that can be broken, and have the fault cleared. */
  repair() {
    for (const side of [0, 1]) {
      this.robot.cutEncoder(side, false);
      this.robot.drive.blocked[side] = false;
    }
    this.robot.drive.battery.charge = this.robot.params.battery.state_of_charge;
    this.link.plugged = true;
    this.repaired = true;
    this.odometry.pose = this.pose;
  }
}
