#pragma once
#include "avr.hpp"
#include "plant.hpp"

namespace thumper {

/// Makes simavr's converter sample when the conversion starts and scale by 1024, as the chip does.
///
/// simavr looks at channel, reference and voltage only when ADCL is read, and scales by 1023. This puts the
/// right value into the data registers one cycle after each conversion's end and marks it as read, so that
/// simavr leaves it alone.
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
