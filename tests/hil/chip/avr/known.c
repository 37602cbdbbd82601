// Known cycle counts: an interrupt of two instructions, twenty with interrupts off, thirty between two marks.
#include "bench.h"

ISR(TIMER1_COMPA_vect, ISR_NAKED) { __asm__ volatile("nop\n\tnop\n\treti"); }

int main(void) {
  OCR1A = 1599;
  TCCR1B = 1 << WGM12 | 1 << CS10;
  TIMSK1 = 1 << OCIE1A;
  for (;;) {
    __asm__ volatile(
        "sei\n\t"
        "ldi r16, 1\n\t"
        "out %0, r16\n\t"
        ".rept 29\n\tnop\n\t.endr\n\t"
        "out %0, r1\n\t"
        "cli\n\t"
        ".rept 20\n\tnop\n\t.endr" ::"I"(_SFR_IO_ADDR(GPIOR0))
        : "r16");
  }
}
