// Sets the bridges from packets of left PWM, right PWM and flags (bits 0, 1: left, right forward; 2, 3:
// brake). Meanwhile it counts quadrature edges and toggles a free pin of each encoder's port at 10 kHz. It
// answers each packet with both counts and the number of edges of unknown direction.
#include "bench.h"

static volatile uint16_t left_count, right_count;
static volatile uint8_t lost;
static uint8_t left_ab, right_ab;

static void step(uint8_t ab, uint8_t* old, volatile uint16_t* count) {
  const uint8_t changed = ab ^ *old;
  if (changed == 3)
    ++lost;
  else if (changed != 0)
    *count += ((ab ^ (*old >> 1)) & 1) != 0 ? 1 : -1;
  *old = ab;
}

ISR(TIMER0_COMPA_vect) {
  PIND = 1 << PD7;  // toggles
  PINB = 1 << PB0;
}

ISR(PCINT2_vect) { step((PIND >> 5) & 3, &left_ab, &left_count); }
ISR(PCINT0_vect) { step((PINB >> 4) & 3, &right_ab, &right_count); }

static void set(uint8_t left_pwm, uint8_t right_pwm, uint8_t flags) {
  cli();
  PORTD = (flags & 1 ? 1 << PD2 : 0) | (flags & 4 ? 1 << PD4 : 0) | 1 << PD5 | 1 << PD6;
  PORTB = (flags & 2 ? 1 << PB2 : 0) | (flags & 8 ? 1 << PB1 : 0) | 1 << PB4 | 1 << PB5;
  OCR2B = left_pwm;
  OCR2A = right_pwm;
  sei();
}

int main(void) {
  uart_start();
  DDRD = 1 << PD2 | 1 << PD3 | 1 << PD4 | 1 << PD7;
  DDRB = 1 << PB0 | 1 << PB1 | 1 << PB2 | 1 << PB3;
  PORTD = 1 << PD5 | 1 << PD6;
  PORTB = 1 << PB4 | 1 << PB5;
  TCCR2A = 1 << WGM20 | 1 << COM2A1 | 1 << COM2B1;
  TCCR2B = 1 << CS22 | 1 << CS21;
  left_ab = (PIND >> 5) & 3;
  right_ab = (PINB >> 4) & 3;
  PCMSK2 = 1 << 5 | 1 << 6;
  PCMSK0 = 1 << 4 | 1 << 5;
  PCICR = 1 << PCIE2 | 1 << PCIE0;
  OCR0A = 199;  // 10 kHz
  TCCR0A = 1 << WGM01;
  TIMSK0 = 1 << OCIE0A;
  TCCR0B = 1 << CS01;
  sei();
  for (;;) {
    while ((UCSR0A & 1 << RXC0) == 0) sleep_mode();
    const uint8_t left_pwm = UDR0;
    const uint8_t right_pwm = uart_get();
    set(left_pwm, right_pwm, uart_get());
    cli();
    const uint16_t left = left_count, right = right_count;
    sei();
    uart_put16(left);
    uart_put16(right);
    uart_put(lost);
  }
}
