// Counts received bytes in the receive interrupt, but keeps interrupts off for 45 of every 145 us. Sends the
// count at the end.
#include <util/delay.h>

#include "bench.h"

static volatile uint16_t count;

ISR(USART_RX_vect) {
  (void)UDR0;
  ++count;
}

int main(void) {
  uart_start();
  UCSR0B |= 1 << RXCIE0;
  for (uint8_t i = 0; i < 180; ++i) {  // 26 ms
    cli();
    _delay_us(45);
    sei();
    _delay_us(100);
  }
  uart_put16(count);
  for (;;) {
  }
}
