// Sleeps with the safe sequence while an interrupt is already pending: each round must end at once.
#include <util/delay.h>

#include "bench.h"

ISR(TIMER0_COMPA_vect) {}

int main(void) {
  uart_start();
  OCR0A = 249;  // a match every millisecond
  TCCR0A = 1 << WGM01;
  TIMSK0 = 1 << OCIE0A;
  TCCR0B = 1 << CS01 | 1 << CS00;
  for (uint8_t round = 0;; ++round) {
    cli();
    _delay_us(1200);  // a match is pending now
    sleep_enable();
    sei();
    sleep_cpu();
    sleep_disable();
    uart_put(round);
  }
}
