// Stops reading for 1 ms after the first byte, then sends how many bytes were left and whether DOR0 was set.
#include <util/delay.h>

#include "bench.h"

int main(void) {
  uart_start();
  for (;;) {
    uint8_t count = 1, overrun = 0;
    uart_get();
    _delay_ms(1);
    while ((UCSR0A & 1 << RXC0) != 0) {
      overrun |= UCSR0A & 1 << DOR0;
      (void)UDR0;
      ++count;
    }
    uart_put(count);
    uart_put(overrun);
  }
}
