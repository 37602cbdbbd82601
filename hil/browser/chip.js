// The ATmega328P with its program: avr8js, whose gaps are closed here. Time is counted in clock cycles.
import {
  AVRADC, AVRClock, AVREEPROM, AVRIOPort, AVRTimer, AVRUSART, AVRWatchdog, CPU, EEPROMMemoryBackend,
  adcConfig, avrInstruction, clockConfig, eepromConfig, portBConfig, portCConfig, portDConfig, timer0Config,
  timer1Config, timer2Config, usart0Config, watchdogConfig,
} from "avr8js";

export const CPU_HZ = 16e6;
const SEI = 0x9478, SLEEP = 0x9588;
const MCUSR = 0x54, POWER_ON = 1, UCSR0B = 0xc1, RECEIVER_ON = 0x10;
const FLASH_WORDS = 0x4000, EEPROM_BYTES = 1024;

/** Return the flash of an Intel HEX file; only data records matter below 64 KiB. */
function readHex(text) {
  const flash = new Uint16Array(FLASH_WORDS).fill(0xffff);
  const bytes = new Uint8Array(flash.buffer);
  for (const line of text.split(/\s+/)) {
    if (line.slice(7, 9) !== "00") continue;
    const address = parseInt(line.slice(3, 7), 16);
    for (let i = 0; i < parseInt(line.slice(1, 3), 16); ++i)
      bytes[address + i] = parseInt(line.slice(9 + 2 * i, 11 + 2 * i), 16);
  }
  return flash;
}

export class Chip {
  /** `hex`: text of the program's HEX file. `onByte(byte)` gets each byte that the program sends. */
  constructor(hex, onByte) {
    this.cpu = new CPU(readHex(hex));
    const clock = new AVRClock(this.cpu, CPU_HZ, clockConfig);
    this.ports = {
      B: new AVRIOPort(this.cpu, portBConfig),
      C: new AVRIOPort(this.cpu, portCConfig),
      D: new AVRIOPort(this.cpu, portDConfig),
    };
    const timers = [timer0Config, timer1Config, timer2Config].map((config) => new AVRTimer(this.cpu, config));
    this.pwmTimer = timers[2];
    this.adc = new AVRADC(this.cpu, adcConfig);
    new AVREEPROM(this.cpu, new EEPROMMemoryBackend(EEPROM_BYTES), eepromConfig);
    new AVRWatchdog(this.cpu, watchdogConfig, clock);
    this.usart = new AVRUSART(this.cpu, usart0Config, CPU_HZ);
    this.usart.onByteTransmit = onByte;
    this.keepReceivedByte();
    this.cpu.data[MCUSR] = POWER_ON;  // avr8js leaves it empty
  }

  get cycle() {
    return this.cpu.cycles;
  }

  setPin(port, bit, level) {
    this.ports[port].setPin(bit, level);
  }

  /** Let a byte from the host begin now. It is lost if another one is still arriving. */
  receive(byte) {
    this.usart.writeByte(byte);
  }

  /** Run until a clock cycle, or a few beyond it. */
  run(until) {
    const { cpu } = this;
    while (cpu.cycles < until) {
      const opcode = cpu.progMem[cpu.pc];
      avrInstruction(cpu);
      if (opcode === SLEEP) this.sleep(until);
      else if (opcode !== SEI) cpu.tick();  // the instruction after SEI runs before any interrupt
    }
  }

  /** Pass the time until an interrupt. avr8js would run the main loop instead, ten times as slow. */
  sleep(until) {
    const { cpu } = this;
    const awake = cpu.pc;
    for (cpu.tick(); cpu.pc === awake && cpu.cycles < until; cpu.tick()) {
      const next = cpu.nextClockEvent ? cpu.nextClockEvent.cycles : until;
      cpu.cycles = Math.max(cpu.cycles, Math.min(next, until));
    }
    if (cpu.pc === awake) --cpu.pc;  // still asleep: sleep again in the next run
  }

  /** avr8js forgets a received byte that waits while the program writes UCSR0B, as it does to send. */
  keepReceivedByte() {
    const hook = this.cpu.writeHooks[UCSR0B];
    this.cpu.writeHooks[UCSR0B] = (value, old, ...more) => hook(value, old & ~RECEIVER_ON, ...more);
  }
}
