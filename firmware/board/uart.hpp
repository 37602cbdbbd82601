#pragma once
#include <avr/io.h>
#include <stdint.h>
#include <util/atomic.h>

/// 500 000 baud is exact at 16 MHz and the fastest the board's USB chip gives.
#ifndef THUMPER_BAUD
#define THUMPER_BAUD 500000UL
#endif

/// USART0 at double speed with a ring each way. OnReceive and OnReady belong in its interrupts.
class Uart {
 public:
  void Start() {
    UCSR0A = 1 << U2X0;  // before the divider: simulators take the rate when that is written
    UBRR0 = kDivider;
    UCSR0C = 1 << UCSZ01 | 1 << UCSZ00;  // 8N1
    UCSR0B = 1 << RXEN0 | 1 << TXEN0 | 1 << RXCIE0;
  }

  /// USART_RX_vect.
  void OnReceive() {
    const uint8_t flags = UCSR0A;  // before UDR0, which moves the queue on
    const uint8_t byte = UDR0;
    const uint8_t next = (rx_head_ + 1) % kSize;
    if ((flags & (1 << FE0 | 1 << DOR0)) != 0 || next == rx_tail_) {
      ++errors_;  // the frame's CRC does the rest
    } else {
      rx_[rx_head_] = byte;
      rx_head_ = next;
    }
  }

  /// USART_UDRE_vect.
  void OnReady() {
    UDR0 = tx_[tx_tail_];
    tx_tail_ = (tx_tail_ + 1) % kSize;
    if (tx_tail_ == tx_head_) UCSR0B &= static_cast<uint8_t>(~(1 << UDRIE0));
  }

  /// Fetch a received byte; false if there is none.
  bool Get(uint8_t* byte) {
    const uint8_t tail = rx_tail_;
    if (tail == rx_head_) return false;
    *byte = rx_[tail];
    rx_tail_ = (tail + 1) % kSize;
    return true;
  }

  /// Queue a byte to send; waits for room, at most one ring's time (1.3 ms). Interrupts must be on.
  void Put(uint8_t byte) {
    const uint8_t head = tx_head_;
    const uint8_t next = (head + 1) % kSize;
    while (next == tx_tail_) {
    }
    tx_[head] = byte;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
      tx_head_ = next;
      UCSR0B |= 1 << UDRIE0;
    }
  }

  bool empty() const { return rx_head_ == rx_tail_; }
  uint16_t errors() const { return errors_; }  ///< bytes lost; read with interrupts off

 private:
  static constexpr uint32_t kDivider = (F_CPU + 4 * THUMPER_BAUD) / (8 * THUMPER_BAUD) - 1;
  static constexpr uint32_t kActual = F_CPU / (8 * (kDivider + 1));
  static_assert(100 * (kActual > THUMPER_BAUD ? kActual - THUMPER_BAUD : THUMPER_BAUD - kActual) <=
                    THUMPER_BAUD,
                "UART baud rate is off by more than 1 %");
  static constexpr uint8_t kSize = 64;
  static_assert((kSize & (kSize - 1)) == 0, "a power of two wraps by masking");

  volatile uint8_t rx_[kSize], tx_[kSize];
  volatile uint8_t rx_head_ = 0, rx_tail_ = 0, tx_head_ = 0, tx_tail_ = 0;
  uint16_t errors_ = 0;
};
