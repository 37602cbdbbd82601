// The assembly encoder interrupt against the C++ decoder, on the same random pins: glitches, double edges,
// and changes on the port's other pins. Every result is written to TWAMR, byte by byte.

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

#include "board/encoder_edge.hpp"
#include "core/quadrature.hpp"

namespace {

// GPIOR1 replaces the port. The encoder pins of both boards: bits 0, 1, bits 4, 5 and bits 5, 6.
using Low = fw::QuadratureDecoder<0x03>;
using Middle = fw::QuadratureDecoder<0x30>;
using High = fw::QuadratureDecoder<0x60>;
Low low;
Middle middle;
High high;

void Put(uint16_t word) {
  TWAMR = static_cast<uint8_t>(word);
  TWAMR = static_cast<uint8_t>(word >> 8);
}

/// Call the interrupt with marked registers and flags. Return false if it changed any of them.
template <void (*kInterrupt)()>
bool KeepsRegisters() {
  uint8_t first = 0x5A, second = 0xA5, flags = 0;
  __asm__ volatile(
      "mov r24, %[first]\n\t"
      "mov r25, %[second]\n\t"
      "ldi r18, 0x7F\n\t"  // all flags except I, which reti sets
      "out __SREG__, r18\n\t"
      "%~call %x[interrupt]\n\t"
      "in %[flags], __SREG__\n\t"
      "cli\n\t"
      "mov %[first], r24\n\t"
      "mov %[second], r25"
      : [first] "+l"(first), [second] "+l"(second), [flags] "=&l"(flags)
      : [interrupt] "i"(kInterrupt)
      : "r18", "r24", "r25", "memory");
  return first == 0x5A && second == 0xA5 && flags == 0xFF;
}

uint32_t random_state = 1;

uint8_t Random() {
  random_state = random_state * 1664525UL + 1013904223UL;
  return static_cast<uint8_t>(random_state >> 24);
}

template <typename Decoder, void (*kInterrupt)()>
void Walk(const Decoder& on_chip) {
  Decoder reference;
  uint8_t phase = 0;
  for (uint16_t step = 0; step < 6000; ++step) {
    // Mostly steps in one direction, alternating after a while, so that the count crosses zero and carries.
    // The rest is random.
    const uint8_t die = Random();
    const uint8_t onward = (step >> 10 & 1) != 0 ? 3 : 1;
    phase = (phase + (die < 200 ? onward : die)) & 3;
    const uint8_t ab = phase ^ phase >> 1;  // Gray code
    const uint8_t a = ab >> 1, b = ab & 1;
    const uint8_t others = Random() & static_cast<uint8_t>(~Decoder::kAB);
    const uint8_t port = others | (a != 0 ? Decoder::kA : 0) | (b != 0 ? Decoder::kA << 1 : 0);
    GPIOR1 = port;
    reference.Step(port);
    const bool unchanged = KeepsRegisters<kInterrupt>();
    Put(on_chip.count());
    Put(on_chip.lost());
    Put(reference.count());
    Put(reference.lost());
    Put(unchanged);
  }
}

}  // namespace

extern "C" {
__attribute__((naked, used)) void StepLow() { encoders::StepOnEdge<Low, low>(_SFR_IO_ADDR(GPIOR1)); }
__attribute__((naked, used)) void StepMiddle() { encoders::StepOnEdge<Middle, middle>(_SFR_IO_ADDR(GPIOR1)); }
__attribute__((naked, used)) void StepHigh() { encoders::StepOnEdge<High, high>(_SFR_IO_ADDR(GPIOR1)); }
}

int main() {
  Walk<Low, StepLow>(low);
  Walk<Middle, StepMiddle>(middle);
  Walk<High, StepHigh>(high);
  cli();
  sleep_enable();
  sleep_cpu();
}
