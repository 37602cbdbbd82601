// Drives both motors until the watchdog resets it. Reports after each start whether the watchdog caused it.
#include <avr/wdt.h>

#include "bench.h"

int main(void) {
  const uint8_t flags = MCUSR;
  MCUSR = 0;
  wdt_enable(WDTO_250MS);
  uart_start();
  DDRD = 1 << PD2 | 1 << PD3;
  DDRB = 1 << PB2 | 1 << PB3;
  PORTD = 1 << PD2 | 1 << PD3;
  PORTB = 1 << PB2 | 1 << PB3;
  uart_put((flags & 1 << WDRF) != 0 ? 'W' : 'P');
  uart_put('.');
  for (;;) {
  }
}
