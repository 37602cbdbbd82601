#pragma once
#include "avr.hpp"
#include "plant.hpp"

namespace thumper {

/// Makes simavr's ADC sample at the start of a conversion and scale by 1024, as the chip does.
///
/// simavr reads channel, reference and voltage only when the program reads ADCL, and scales by 1023. This
/// class writes the correct value to the data registers one cycle after the end of each conversion. It marks
/// the result as read, so that simavr does not overwrite it.
class AdcLatch {
 public:
  AdcLatch(avr_t* avr, const Plant& plant);

 private:
  static void OnStart(avr_irq_t* irq, uint32_t mux, void* self);
  static avr_cycle_count_t OnResult(avr_t* avr, avr_cycle_count_t when, void* self);
  uint16_t Sample(const avr_adc_mux_t& mux) const;

  avr_t* avr_;
  const Plant& plant_;
  avr_adc_t* adc_;
  uint16_t result_ = 0;
};

}  // namespace thumper
