// Runs a program on avr8js with stimuli at given clock cycles; prints the bytes that it sends.
// stdin: {hex, until, events: [[cycle, "byte", value] | [cycle, port, bit, level]]}; argument: folder of avr8js.
import { createRequire } from "node:module";
import { readFileSync } from "node:fs";

const js = createRequire(process.argv[2] + "/")("avr8js");
const { hex, until, events } = JSON.parse(readFileSync(0, "utf8"));
const HZ = 16e6;

const flash = new Uint16Array(0x4000).fill(0xffff);
const bytes = new Uint8Array(flash.buffer);
for (const line of hex.split(/\s+/)) {
  if (line.slice(7, 9) !== "00") continue;
  const address = parseInt(line.slice(3, 7), 16);
  for (let i = 0; i < parseInt(line.slice(1, 3), 16); ++i)
    bytes[address + i] = parseInt(line.slice(9 + 2 * i, 11 + 2 * i), 16);
}

const cpu = new js.CPU(flash);
const clock = new js.AVRClock(cpu, HZ, js.clockConfig);
const ports = {
  B: new js.AVRIOPort(cpu, js.portBConfig),
  C: new js.AVRIOPort(cpu, js.portCConfig),
  D: new js.AVRIOPort(cpu, js.portDConfig),
};
for (const config of [js.timer0Config, js.timer1Config, js.timer2Config]) new js.AVRTimer(cpu, config);
new js.AVRADC(cpu, js.adcConfig);
new js.AVREEPROM(cpu, new js.EEPROMMemoryBackend(1024));
new js.AVRWatchdog(cpu, js.watchdogConfig, clock);
const usart = new js.AVRUSART(cpu, js.usart0Config, HZ);
const sent = [];
usart.onByteTransmit = (value) => sent.push(value);

cpu.data[0x54] = 1;  // MCUSR: power on, which avr8js leaves empty
let next = 0;
while (cpu.cycles < until) {
  while (next < events.length && events[next][0] <= cpu.cycles) {
    const [, what, a, b] = events[next++];
    if (what === "byte") usart.writeByte(a);
    else ports[what].setPin(a, b);
  }
  js.avrInstruction(cpu);
  cpu.tick();
}
process.stdout.write(Buffer.from(sent).toString("hex"));
