// Sends 64 bytes as fast as the UART accepts them, then echoes received bytes from the receive interrupt.
#include "bench.h"

ISR(USART_RX_vect) { UDR0 = UDR0; }

int main(void) {
  uart_start();
  for (uint8_t i = 0; i < 64; ++i) uart_put(i);
  UCSR0B |= 1 << RXCIE0;
  sei();
  for (;;) sleep_mode();
}
