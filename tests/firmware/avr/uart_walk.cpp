// The serial port's two assembly interrupts against ring buffers in C++, with random traffic. Every result is
// written to TWAMR.

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

#include "board/uart_interrupts.hpp"

namespace {

// EEDR replaces the data register.
Uart uart;

/// Reference for OnReceive and OnReady.
struct Ring {
  uint8_t bytes[Uart::kSize];
  uint8_t head = 0, tail = 0;
  static uint8_t After(uint8_t index) { return (index + 1) % Uart::kSize; }
  void Add(uint8_t byte) {
    if (After(head) == tail) return;
    bytes[head] = byte;
    head = After(head);
  }
};

/// Call the interrupt with marked registers and flags. Return false if it changed any of them.
template <void (*kInterrupt)()>
bool KeepsRegisters() {
  uint8_t r24 = 0x5A, r30 = 0xA5, r31 = 0x3C, flags = 0;
  __asm__ volatile(
      "mov r24, %[r24]\n\t"
      "mov r30, %[r30]\n\t"
      "mov r31, %[r31]\n\t"
      "ldi r18, 0x7F\n\t"  // all flags except I, which reti sets
      "out __SREG__, r18\n\t"
      "%~call %x[interrupt]\n\t"
      "in %[flags], __SREG__\n\t"
      "cli\n\t"
      "mov %[r24], r24\n\t"
      "mov %[r30], r30\n\t"
      "mov %[r31], r31"
      : [r24] "+l"(r24), [r30] "+l"(r30), [r31] "+l"(r31), [flags] "=&l"(flags)
      : [interrupt] "i"(kInterrupt)
      : "r18", "r24", "r30", "r31", "memory");
  return r24 == 0x5A && r30 == 0xA5 && r31 == 0x3C && flags == 0xFF;
}

uint32_t random_state = 1;

uint8_t Random() {
  random_state = random_state * 1664525UL + 1013904223UL;
  return static_cast<uint8_t>(random_state >> 24);
}

}  // namespace

extern "C" {
__attribute__((naked, used)) void Receive() { uart_interrupts::OnReceive<uart>(_SFR_MEM_ADDR(EEDR)); }
__attribute__((naked, used)) void Ready() { uart_interrupts::OnReady<uart>(_SFR_MEM_ADDR(EEDR)); }
}

int main() {
  Ring ring;
  // Fill and drain alternately, beyond full and beyond empty.
  for (uint16_t step = 0; step < 6000; ++step) {
    const bool filling = (step >> 7 & 1) == 0;
    const bool in = (Random() & 7) != 0 ? filling : !filling;
    bool unchanged = true;
    uint8_t here = 0, there = 0;
    if (in) {
      EEDR = here = Random();
      ring.Add(here);
      unchanged = KeepsRegisters<Receive>();
      there = here;
    } else if (ring.head != ring.tail) {
      there = ring.bytes[ring.tail];
      ring.tail = Ring::After(ring.tail);
      unchanged = uart.Get(&here);
    } else {
      unchanged = !uart.Get(&here);
    }
    TWAMR = in;
    TWAMR = here;
    TWAMR = there;
    TWAMR = unchanged;
    TWAMR = uart.empty() == (ring.head == ring.tail);
  }
  // Send bursts of 1 to 63 bytes, until the interrupt disables itself.
  for (uint16_t burst = 1; burst < Uart::kSize; ++burst) {
    const uint8_t first = Random();
    for (uint8_t i = 0; i < burst; ++i) {
      uart.tx_[uart.tx_head_] = first + i;
      uart.tx_head_ = Ring::After(uart.tx_head_);
    }
    UCSR0B = 0;
    uint8_t sent = 0;
    bool unchanged = true, right = true;
    while (UCSR0B == 0 && sent < burst + 2) {
      unchanged = KeepsRegisters<Ready>() && unchanged;
      right = right && EEDR == static_cast<uint8_t>(first + sent);
      ++sent;
    }
    TWAMR = 2;
    TWAMR = sent;
    TWAMR = static_cast<uint8_t>(burst);
    TWAMR = unchanged;
    TWAMR = right && UCSR0B == Uart::kOn;
  }
  cli();
  sleep_enable();
  sleep_cpu();
}
