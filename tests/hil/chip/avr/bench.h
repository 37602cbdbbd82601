// Shared by the test firmwares: a polled UART at 500 000 baud. They test the simulator, not the product.
#pragma once
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <stdint.h>

static inline void uart_start(void) {
  UBRR0 = 3;  // before U2X0, which is allowed: the simulated line must accept it
  UCSR0A = 1 << U2X0;
  UCSR0C = 1 << UCSZ01 | 1 << UCSZ00;
  UCSR0B = 1 << RXEN0 | 1 << TXEN0;
}

static inline void uart_put(uint8_t byte) {
  while ((UCSR0A & 1 << UDRE0) == 0) {
  }
  UDR0 = byte;
}

static inline void uart_put16(uint16_t value) {
  uart_put(value & 0xFF);
  uart_put(value >> 8);
}

static inline uint8_t uart_get(void) {
  while ((UCSR0A & 1 << RXC0) == 0) {
  }
  return UDR0;
}
