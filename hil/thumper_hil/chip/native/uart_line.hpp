#pragma once
#include <cstddef>
#include <cstdint>
#include <deque>

#include "avr.hpp"
#include "random.hpp"

namespace thumper {

/// Serial line between chip and host: 8N1, one byte per ten bit times, in both directions.
///
/// Fixes for simavr's UART: a byte takes ten bits, not eleven, in any order of U2X and UBRR writes. A
/// received byte is available when its last bit has arrived. A receiver that the program does not read
/// overruns after two bytes plus the one in the shift register.
class UartLine {
 public:
  UartLine(avr_t* avr, uint64_t seed);

  void SetHostBaud(uint32_t baud) { host_baud_ = baud; }

  /// Simulate a bad cable in both directions: share of lost bytes, and share of bytes with one wrong bit.
  void SetNoise(double loss, double flip) {
    loss_ = loss;
    flip_ = flip;
  }
  void Send(const uint8_t* data, std::size_t count);  ///< host to chip, from now on at line rate
  void Arrive(uint8_t byte);                          ///< a byte for the chip whose last bit arrives now
  std::size_t Receive(uint8_t* data, uint64_t* cycles,
                      std::size_t capacity);  ///< bytes that have fully arrived
  std::size_t Available() const;
  bool idle() const { return to_chip_.empty(); }  ///< no byte is on its way to the chip
  uint64_t overruns() const { return overruns_; }

  void Rearm();          ///< after a reset
  void OnReceiveDone();  ///< the receive interrupt has returned

 private:
  struct Arrival {
    uint64_t cycle;  // end of its stop bit
    uint8_t byte;
  };

  static avr_cycle_count_t OnByteTime(avr_t* avr, avr_cycle_count_t when, void* self);
  static void OnTransmit(avr_irq_t* irq, uint32_t byte, void* self);
  uint32_t CyclesPerByte() const;
  bool SameBaud() const;
  bool SurvivesNoise(uint8_t& byte);

  avr_t* avr_;
  avr_uart_t* uart_;
  uint32_t host_baud_ = 0;  // 0: the chip's baud rate
  std::deque<uint8_t> to_chip_;
  std::deque<Arrival> from_chip_;
  uint64_t line_free_cycle_ = 0;
  uint64_t overruns_ = 0;
  double loss_ = 0.0, flip_ = 0.0;
  Random random_;
};

}  // namespace thumper
