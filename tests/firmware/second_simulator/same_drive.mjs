// Drives the robot of the browser with bytes and faults at given milliseconds; prints what its board sends.
// stdin: {hex, params, until_ms, sent: {ms: [byte, ...]}, cut, restored, blocked: {ms: side}}
import { readFileSync } from "node:fs";
import { Robot } from "../../../hil/browser/robot.js";

const { hex, params, until_ms, sent, cut, restored, blocked } = JSON.parse(readFileSync(0, "utf8"));
const bytes = [];
const robot = new Robot({ hex, params, onByte: (byte) => bytes.push(byte) });
for (let ms = 0; ms < until_ms; ++ms) {
  if (ms in sent) robot.send(sent[ms]);
  if (ms in cut) robot.cutEncoder(cut[ms], true);
  if (ms in restored) robot.cutEncoder(restored[ms], false);
  if (ms in blocked) robot.drive.blocked[blocked[ms]] = true;
  robot.step();
}
const { x_m, y_m, yaw_rad } = robot.drive.pose;
const truth = { x_m, y_m, yaw_rad, battery_V: robot.drive.battery.voltage_V };
process.stdout.write(JSON.stringify({ bytes, truth }));
