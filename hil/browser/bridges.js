// What the H-bridges of the T'REX board get from the chip's pins (hil/thumper_hil/chip/native/bridge.hpp).

const PORTB = 0x25, DDRB = 0x24, PORTD = 0x2b, DDRD = 0x2a, TCCR2A = 0xb0;
const PWM_BIT = 3;
const WIRING = [
  { port: PORTD, ddr: DDRD, forward: 2, brake: 4, mode_shift: 4, compare: "ocrB" },
  { port: PORTB, ddr: DDRB, forward: 2, brake: 1, mode_shift: 6, compare: "ocrA" },
];
const COAST = { duty: 0, forward: false, brake: true };

/** Return duty (0...1), direction and brake of the left and the right bridge. */
export function bridgeCommands(chip) {
  return WIRING.map((pins) => command(chip, pins));
}

function command(chip, pins) {
  const { data } = chip.cpu;
  const driven = (bit) => ((data[pins.ddr] & data[pins.port]) >> bit) & 1;
  if (!((data[pins.ddr] >> PWM_BIT) & 1)) return COAST;  // a floating pin drives no transistor
  const connected = ((data[TCCR2A] >> pins.mode_shift) & 3) === 2;
  const duty = connected ? chip.pwmTimer[pins.compare] / 255 : driven(PWM_BIT);
  if (duty === 0) return COAST;
  return { duty, forward: driven(pins.forward) === 1, brake: driven(pins.brake) === 1 };
}
