// Hangs with interrupts on, then with interrupts off, under a watchdog in interrupt-and-reset mode.
#include <avr/wdt.h>

#include "bench.h"

static volatile uint8_t bites;

ISR(WDT_vect) {
  uart_put('I');
  ++bites;
}

int main(void) {
  const uint8_t flags = MCUSR;
  MCUSR = 0;
  wdt_disable();
  uart_start();
  uart_put((flags & 1 << WDRF) != 0 ? 'W' : 'P');
  if ((flags & 1 << WDRF) == 0) {
    WDTCSR = 1 << WDCE | 1 << WDE;
    WDTCSR = 1 << WDIE | 1 << WDE | 1 << WDP1 | 1 << WDP0;  // 128 ms
    sei();
    while (bites == 0) {
    }
    wdt_reset();
    WDTCSR |= 1 << WDIE;
    cli();
  }
  for (;;) {
  }
}
