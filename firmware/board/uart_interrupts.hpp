#pragma once
#include <avr/io.h>

#include "board/uart.hpp"

/// Bodies of the serial port's two naked interrupts. The compiler's versions take 61 cycles, and encoder
/// edges wait that long. As in encoder_edge.hpp, the flags are saved in GPIOR0, because nothing interrupts
/// these.
namespace uart_interrupts {

/// USART_RX_vect: 41 cycles, 42 if its vector needs a long jump. If the buffer is full or the byte is
/// damaged, the frame fails its CRC later. data: address of the data register. It must be a constant, but not
/// a template parameter, because gcc 7 accepts no register there.
template <Uart& kUart>
__attribute__((always_inline)) inline void OnReceive(uint16_t data) {
  __asm__ volatile(
      "push r24\n\t"
      "in r24, __SREG__\n\t"
      "out %[flags], r24\n\t"
      "push r30\n\t"
      "push r31\n\t"
      // rx[head] = data: this cell is always free, because the ring is never quite full.
      "lds r24, %[data]\n\t"
      "in r30, %[head]\n\t"
      "ldi r31, 0\n\t"
      "subi r30, lo8(-(%[rx]))\n\t"
      "sbci r31, hi8(-(%[rx]))\n\t"
      "st Z, r24\n\t"
      // Advance the head unless it would meet the tail.
      "in r24, %[head]\n\t"
      "inc r24\n\t"
      "andi r24, %[mask]\n\t"
      "lds r30, %[tail]\n\t"
      "cpse r24, r30\n\t"
      "out %[head], r24\n\t"
      "pop r31\n\t"
      "pop r30\n\t"
      "in r24, %[flags]\n\t"
      "out __SREG__, r24\n\t"
      "pop r24\n\t"
      "reti"
      :
      : [flags] "I"(_SFR_IO_ADDR(GPIOR0)), [head] "I"(_SFR_IO_ADDR(GPIOR1)), [data] "i"(data),
        [rx] "i"(&kUart.rx_[0]), [tail] "i"(&kUart.rx_tail_), [mask] "M"(Uart::kSize - 1)
      : "memory");
}

/// USART_UDRE_vect: 43 cycles, 44 with a long jump. The last byte takes 2 more and disables this interrupt.
template <Uart& kUart>
__attribute__((always_inline)) inline void OnReady(uint16_t data) {
  __asm__ volatile(
      "push r24\n\t"
      "in r24, __SREG__\n\t"
      "out %[flags], r24\n\t"
      "push r30\n\t"
      "push r31\n\t"
      // data = tx[tail]
      "in r30, %[tail]\n\t"
      "ldi r31, 0\n\t"
      "subi r30, lo8(-(%[tx]))\n\t"
      "sbci r31, hi8(-(%[tx]))\n\t"
      "ld r24, Z\n\t"
      "sts %[data], r24\n\t"
      // Advance the tail. If it meets the head, everything is sent.
      "in r24, %[tail]\n\t"
      "inc r24\n\t"
      "andi r24, %[mask]\n\t"
      "out %[tail], r24\n\t"
      "lds r30, %[head]\n\t"
      "cp r24, r30\n\t"
      "brne 1f\n\t"
      "ldi r24, %[on]\n\t"
      "sts %[control], r24\n"
      "1:\n\t"
      "pop r31\n\t"
      "pop r30\n\t"
      "in r24, %[flags]\n\t"
      "out __SREG__, r24\n\t"
      "pop r24\n\t"
      "reti"
      :
      : [flags] "I"(_SFR_IO_ADDR(GPIOR0)), [tail] "I"(_SFR_IO_ADDR(GPIOR2)), [data] "i"(data),
        [tx] "i"(&kUart.tx_[0]), [head] "i"(&kUart.tx_head_), [mask] "M"(Uart::kSize - 1),
        [control] "i"(_SFR_MEM_ADDR(UCSR0B)), [on] "M"(int{Uart::kOn})
      : "memory");
}

}  // namespace uart_interrupts
