// The robot without its surroundings: the chip, and what is wired to its pins. Time advances in milliseconds.
import { bridgeCommands } from "./bridges.js";
import { CPU_HZ, Chip } from "./chip.js";
import { DriveTrain } from "./drive_train.js";
import { Encoder } from "./encoder.js";

const CYCLES_PER_MS = CPU_HZ / 1000;
const CYCLES_PER_BYTE = 330;  // 500 000 baud takes 320
const ENCODER_PINS = [{ port: "D", a: 5, b: 6 }, { port: "B", a: 4, b: 5 }];
const INPUT_PINS = [{ port: "D", bit: 7 }, { port: "B", bit: 0 }];
const BATTERY_CHANNEL = 3, CURRENT_CHANNELS = [6, 7];
const V_PER_COUNT = 5 / 1024;

export class Robot {
  /** `hex`: the firmware's HEX file. `onByte(byte)`: what the board sends. */
  constructor({ hex, params, onByte }) {
    this.params = params;
    this.chip = new Chip(hex, onByte);
    this.drive = new DriveTrain(params);
    this.encoders = [0, 1].map(() => new Encoder(params.encoder.counts_per_rev));
    this.cycle = 0;
    this.outbox = [];  // bytes on their way to the board
    for (const side of [0, 1]) this.driveWires(side);
    for (const { port, bit } of INPUT_PINS) this.chip.setPin(port, bit, true);
    this.measure();
  }

  get time_s() {
    return this.cycle / CPU_HZ;
  }

  /** Queue bytes for the board. They begin with the next millisecond, at line rate. */
  send(bytes) {
    this.outbox.push(...bytes);
  }

  /** Advance by one millisecond: plan the motion with the current bridge commands, then run the chip through it. */
  step() {
    const before = [...this.drive.wheel_rad];
    this.drive.step(bridgeCommands(this.chip), CYCLES_PER_MS / CPU_HZ);
    this.measure();
    const events = this.bytesToSend();
    for (const side of [0, 1]) {
      const plan = this.encoders[side].edges(before[side], this.drive.wheel_rad[side], this.cycle, CYCLES_PER_MS);
      for (const [cycle, step] of plan) events.push([cycle, () => this.passEdge(side, step)]);
    }
    events.sort((one, other) => one[0] - other[0]);
    for (const [cycle, happen] of events) {
      this.chip.run(cycle);
      happen();
    }
    this.cycle += CYCLES_PER_MS;
    this.chip.run(this.cycle);
  }

  bytesToSend() {
    const bytes = this.outbox.splice(0, Math.floor(CYCLES_PER_MS / CYCLES_PER_BYTE));
    return bytes.map((byte, i) => [this.cycle + i * CYCLES_PER_BYTE, () => this.chip.receive(byte)]);
  }

  passEdge(side, step) {
    this.encoders[side].count += step;
    this.driveWires(side);
  }

  driveWires(side) {
    const { port, a, b } = ENCODER_PINS[side];
    this.chip.setPin(port, a, this.encoders[side].a);
    this.chip.setPin(port, b, this.encoders[side].b);
  }

  cutEncoder(side, cut) {
    this.encoders[side].cut = cut;
    this.driveWires(side);
  }

  /** Set the voltages at the ADC's inputs. */
  measure() {
    const { battery_V_per_count, current_zero_counts, current_A_per_count } = this.params.board;
    const volts = this.chip.adc.channelValues;
    volts[BATTERY_CHANNEL] = (this.drive.battery.voltage_V / battery_V_per_count) * V_PER_COUNT;
    this.drive.current_A.forEach((current_A, side) => {
      volts[CURRENT_CHANNELS[side]] = (current_zero_counts + current_A / current_A_per_count) * V_PER_COUNT;
    });
  }
}
