#pragma once
#include "avr.hpp"
#include "input_pin.hpp"

namespace thumper {

/// Ideal encoder on two pins of a chip: forward edges at a constant interval, for measurements.
class EdgeSource {
 public:
  EdgeSource(avr_t* avr, char port, int a_bit, int b_bit)
      : avr_(avr), port_(FindPeripheral<avr_ioport_t>(avr, "port", port)), a_bit_(a_bit), b_bit_(b_bit) {
    port_->external.pull_mask |= static_cast<uint8_t>((1u << a_bit) | (1u << b_bit));
    DriveInput(port_, a_bit_, false);
    DriveInput(port_, b_bit_, false);
  }
  ~EdgeSource() { avr_cycle_timer_cancel(avr_, OnEdge, this); }
  EdgeSource(const EdgeSource&) = delete;
  EdgeSource& operator=(const EdgeSource&) = delete;

  /// Generate `count` edges, the first one `delay` cycles from now.
  void Start(uint64_t delay, uint64_t interval, uint64_t count) {
    interval_ = interval;
    remaining_ = count;
    if (count > 0) avr_cycle_timer_register(avr_, delay, OnEdge, this);
  }

 private:
  static avr_cycle_count_t OnEdge(avr_t*, avr_cycle_count_t when, void* self) {
    EdgeSource* source = static_cast<EdgeSource*>(self);
    source->phase_ = (source->phase_ + 1) & 3;
    // 00, 10, 11, 01 (A, B): A leads.
    DriveInput(source->port_, source->a_bit_, source->phase_ == 1 || source->phase_ == 2);
    DriveInput(source->port_, source->b_bit_, source->phase_ >= 2);
    return --source->remaining_ > 0 ? when + source->interval_ : 0;
  }

  avr_t* avr_;
  avr_ioport_t* port_;
  int a_bit_, b_bit_;
  unsigned phase_ = 0;
  uint64_t interval_ = 0, remaining_ = 0;
};

}  // namespace thumper
