#pragma once
#include <avr/io.h>

namespace encoders {

/// Complete body of a naked interrupt: fw::QuadratureDecoder::Step() on the port, in assembly.
/// port: I/O address of the port's input register. It must be a constant, but not a template parameter,
/// because gcc 7 accepts no register there.
/// The compiler's version takes 17 cycles more, half of them to save registers that it does not use, and the
/// edges of both wheels wait for each other. This version needs two registers and the flags. Nothing
/// interrupts it, so the flags can stay in GPIOR0, which is faster than the stack.
template <typename Decoder, Decoder& kDecoder>
__attribute__((always_inline)) inline void StepOnEdge(uint8_t port) {
  __asm__ volatile(
      "push r24\n\t"
      "in r24, __SREG__\n\t"
      "out %[flags], r24\n\t"
      "push r25\n\t"
      // r24 = new pins, T = old B, r25 = changed pins.
      "in r24, %[port]\n\t"
      "andi r24, %[pins]\n\t"
      "lds r25, %[ab]\n\t"
      "bst r25, %[b]\n\t"
      "eor r25, r24\n\t"
      "breq 9f\n\t"  // a glitch that ended before the read
      "sts %[ab], r24\n\t"
      "cpi r25, %[pins]\n\t"
      "breq 3f\n\t"  // both changed
      // Forward if new A differs from old B: bit A of r25.
      "bld r25, %[a]\n\t"
      "eor r25, r24\n\t"
      "lds r24, %[low]\n\t"
      "sbrs r25, %[a]\n\t"
      "rjmp 1f\n\t"
      // Forward: carry into the upper byte only if the lower one has wrapped.
      "inc r24\n\t"
      "sts %[low], r24\n\t"
      "brne 9f\n\t"
      "lds r24, %[high]\n\t"
      "inc r24\n\t"
      "sts %[high], r24\n\t"
      "rjmp 9f\n"
      // Backward, likewise.
      "1:\n\t"
      "subi r24, 1\n\t"
      "sts %[low], r24\n\t"
      "brcc 9f\n\t"
      "lds r24, %[high]\n\t"
      "dec r24\n\t"
      "sts %[high], r24\n\t"
      "rjmp 9f\n"
      // Direction unknown: count a lost edge.
      "3:\n\t"
      "lds r24, %[lost_low]\n\t"
      "inc r24\n\t"
      "sts %[lost_low], r24\n\t"
      "brne 9f\n\t"
      "lds r24, %[lost_high]\n\t"
      "inc r24\n\t"
      "sts %[lost_high], r24\n"
      "9:\n\t"
      "pop r25\n\t"
      "in r24, %[flags]\n\t"
      "out __SREG__, r24\n\t"
      "pop r24\n\t"
      "reti"
      :
      : [port] "I"(port), [flags] "I"(_SFR_IO_ADDR(GPIOR0)), [pins] "M"(Decoder::kAB),
        [a] "I"(__builtin_ctz(Decoder::kA)), [b] "I"(__builtin_ctz(Decoder::kA) + 1), [ab] "i"(&kDecoder.ab_),
        [low] "i"(&kDecoder.low_), [high] "i"(&kDecoder.high_), [lost_low] "i"(&kDecoder.lost_low_),
        [lost_high] "i"(&kDecoder.lost_high_)
      : "memory");
}

}  // namespace encoders
