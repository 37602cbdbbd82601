// Writes two bytes of the EEPROM, the second one without waiting. Sends the time of the first write
// [256 cycles] and both bytes.
#include "bench.h"

static void write(uint8_t address, uint8_t byte) {
  EEAR = address;
  EEDR = byte;
  EECR = 1 << EEMPE;
  EECR |= 1 << EEPE;
}

static uint8_t read(uint8_t address) {
  EEAR = address;
  EECR |= 1 << EERE;
  return EEDR;
}

int main(void) {
  uart_start();
  TCCR1B = 1 << CS12;  // counts 256 cycles
  write(0, 0x55);
  TCNT1 = 0;
  write(1, 0x66);
  while ((EECR & 1 << EEPE) != 0) {
  }
  uart_put16(TCNT1);
  uart_put16(read(0));
  uart_put16(read(1));
  cli();
  for (;;) {
  }
}
