#pragma once
#include <avr/io.h>
#include <stdint.h>
#include <util/atomic.h>

/// 500 000 baud is exact at 16 MHz, and it is the fastest rate of the board's USB chip.
#ifndef THUMPER_BAUD
#define THUMPER_BAUD 500000UL
#endif

/// USART0 at double speed with a ring buffer for each direction. Its interrupts are in uart_interrupts.hpp.
class Uart {
 public:
  void Start() {
    UCSR0A = 1 << U2X0;  // before the divider: simulators read the rate on that write
    UBRR0 = kDivider;
    UCSR0C = 1 << UCSZ01 | 1 << UCSZ00;  // 8N1
    RxHead() = TxTail() = 0;
    UCSR0B = kOn;
  }

  /// Read a received byte; false if there is none.
  bool Get(uint8_t* byte) {
    const uint8_t tail = rx_tail_;
    if (tail == RxHead()) return false;
    *byte = rx_[tail];
    rx_tail_ = After(tail);
    return true;
  }

  /// Queue a byte to send. Waits while the buffer is full: for one byte, 20 us at 500 000 baud. Call with
  /// interrupts on.
  void Put(uint8_t byte) {
    const uint8_t head = tx_head_;
    const uint8_t next = After(head);
    while (next == TxTail()) {
    }
    tx_[head] = byte;
    ATOMIC_BLOCK(ATOMIC_FORCEON) {
      tx_head_ = next;
      UCSR0B = kOn | 1 << UDRIE0;
    }
  }

  bool empty() const { return RxHead() == rx_tail_; }

  // For the interrupts.
  static constexpr uint8_t kSize = 64;
  static_assert((kSize & (kSize - 1)) == 0, "the size must be a power of two to wrap by masking");
  static constexpr uint8_t kOn = 1 << RXEN0 | 1 << TXEN0 | 1 << RXCIE0;

  // The interrupts write these two indices, so they are in scratch registers: one cycle less per access.
  static volatile uint8_t& RxHead() { return GPIOR1; }
  static volatile uint8_t& TxTail() { return GPIOR2; }

  volatile uint8_t rx_[kSize], tx_[kSize];
  volatile uint8_t rx_tail_ = 0, tx_head_ = 0;

 private:
  static constexpr uint32_t kDivider = (F_CPU + 4 * THUMPER_BAUD) / (8 * THUMPER_BAUD) - 1;
  static constexpr uint32_t kActual = F_CPU / (8 * (kDivider + 1));
  static_assert(100 * (kActual > THUMPER_BAUD ? kActual - THUMPER_BAUD : THUMPER_BAUD - kActual) <=
                    THUMPER_BAUD,
                "UART baud rate is off by more than 1 %");

  /// 8-bit arithmetic.
  static uint8_t After(uint8_t index) {
    ++index;
    index &= kSize - 1;
    return index;
  }
};
