// Runs a program on avr8js with stimuli at given clock cycles; prints the bytes that it sends.
// stdin: {hex, until, events: [[cycle, "byte", value] | [cycle, port, bit, level]]}
import { readFileSync } from "node:fs";
import { Chip } from "../../../hil/browser/chip.js";

const { hex, until, events } = JSON.parse(readFileSync(0, "utf8"));
const sent = [];
const chip = new Chip(hex, (byte) => sent.push(byte));
for (const [cycle, what, a, b] of events) {
  chip.run(cycle);
  if (what === "byte") chip.receive(a);
  else chip.setPin(what, a, b);
}
chip.run(until);
process.stdout.write(Buffer.from(sent).toString("hex"));
