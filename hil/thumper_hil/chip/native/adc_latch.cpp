#include "adc_latch.hpp"

#include <algorithm>

namespace thumper {
namespace {

constexpr uint8_t kStart = 1u << 6, kFinished = 1u << 4;  // ADSC, ADIF

}  // namespace

AdcLatch::AdcLatch(avr_t* avr, const Plant& plant)
    : avr_(avr), plant_(plant), adc_(FindPeripheral<avr_adc_t>(avr, "adc")) {
  avr_irq_register_notify(adc_->io.irq + ADC_IRQ_OUT_TRIGGER, OnStart, this);
  avr_register_io_write(avr_, reg::kAdcsrA, OnControl, this);  // called after simavr's own
}

void AdcLatch::SetStopped(bool stopped) {
  uint8_t& control = avr_->data[reg::kAdcsrA];
  if (stopped_ && !stopped) control = static_cast<uint8_t>((control & ~kStart) | kFinished);
  stopped_ = stopped;
}

void AdcLatch::OnControl(avr_t* avr, avr_io_addr_t, uint8_t value, void*) {
  if ((value & kFinished) != 0) avr->data[reg::kAdcsrA] &= static_cast<uint8_t>(~kFinished);
}

void AdcLatch::OnStart(avr_irq_t*, uint32_t mux, void* self) {
  AdcLatch* latch = static_cast<AdcLatch*>(self);
  avr_adc_mux_t selected;
  static_assert(sizeof selected >= sizeof mux, "simavr passes the multiplexer setting as 32 bits");
  std::memcpy(&selected, &mux, sizeof mux);
  latch->result_ = latch->Sample(selected);
  // Same integer arithmetic as simavr: its result is ready exactly one cycle before this one.
  const uint32_t shift = std::max(latch->avr_->data[reg::kAdcsrA] & 7, 1);
  const uint32_t rate_Hz = (latch->avr_->frequency >> shift) / (latch->adc_->first ? 25 : 13);
  avr_cycle_timer_register(latch->avr_, latch->avr_->frequency / rate_Hz + 1, OnResult, latch);
}

avr_cycle_count_t AdcLatch::OnResult(avr_t* avr, avr_cycle_count_t, void* self) {
  AdcLatch* latch = static_cast<AdcLatch*>(self);
  if (latch->stopped_) {
    avr->data[reg::kAdcsrA] = static_cast<uint8_t>((avr->data[reg::kAdcsrA] | kStart) & ~kFinished);
    return 0;
  }
  constexpr uint8_t kLeftAdjust = 1u << 5;
  const bool left = (avr->data[reg::kAdmux] & kLeftAdjust) != 0;
  const uint16_t value = static_cast<uint16_t>(latch->result_ << (left ? 6 : 0));
  avr->data[reg::kAdcL] = static_cast<uint8_t>(value & 0xFF);
  avr->data[reg::kAdcH] = static_cast<uint8_t>(value >> 8);
  latch->adc_->read_status = 1;
  return 0;
}

uint16_t AdcLatch::Sample(const avr_adc_mux_t& mux) const {
  double volt = 0.0;
  if (mux.kind == ADC_MUX_SINGLE) volt = plant_.AnalogIn_V(static_cast<int>(mux.src));
  if (mux.kind == ADC_MUX_REF) volt = static_cast<double>(mux.src) / 1000.0;
  constexpr uint8_t kInternalReference = 3;
  const bool internal = (avr_->data[reg::kAdmux] >> 6) == kInternalReference;
  const double reference_V = internal ? 1.1 : static_cast<double>(avr_->avcc) / 1000.0;
  constexpr double kTop = 1023.0;
  return static_cast<uint16_t>(std::clamp(volt / reference_V * 1024.0, 0.0, kTop));
}

}  // namespace thumper
