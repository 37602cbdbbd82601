// Measures the cycles from a compare match to the timer read in the handler's first instruction.
#include "bench.h"

ISR(TIMER1_COMPA_vect, ISR_NAKED) {
  asm volatile(
      "lds r24, 0x84\n\t"  // TCNT1L; the main loop uses no register
      "cli\n\t"
      "sts 0xC6, r24\n\t"  // UDR0
      "1: rjmp 1b\n\t" ::);
}

int main(void) {
  uart_start();
  OCR1A = 100;
  TCNT1 = 0;
  TIMSK1 = 1 << OCIE1A;
  TCCR1B = 1 << CS10;
  sei();
  for (;;)
    asm volatile(
        "nop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop\n\t");
}
