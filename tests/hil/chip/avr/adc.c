// Converts the battery channel, but selects another channel before it reads the result. Then the motor
// current, then the band gap.
#include "bench.h"

static void convert(uint8_t channel, uint8_t next_channel) {
  ADMUX = 1 << REFS0 | channel;
  ADCSRA |= 1 << ADSC;
  while ((ADCSRA & 1 << ADSC) != 0) {
  }
  ADMUX = 1 << REFS0 | next_channel;
  uart_put16(ADC);
}

int main(void) {
  uart_start();
  ADCSRA = 1 << ADEN | 1 << ADPS2 | 1 << ADPS1 | 1 << ADPS0;
  convert(3, 6);
  convert(6, 3);
  convert(14, 0);
  cli();
  for (;;) {
  }
}
