#pragma once
#include "avr.hpp"
#include "plant.hpp"

namespace thumper {

/// Makes simavr's ADC sample at the start of a conversion and scale by 1024, as the chip does.
///
/// simavr reads channel, reference and voltage only when the program reads ADCL, and scales by 1023. This
/// class writes the correct value to the data registers one cycle after the end of each conversion. It marks
/// the result as read, so that simavr does not overwrite it. simavr also keeps the flag of a finished
/// conversion for ever; here, writing 1 to it clears it.
class AdcLatch {
 public:
  AdcLatch(avr_t* avr, const Plant& plant);

  /// Let no conversion finish from now on, as a converter without its clock or supply.
  void SetStopped(bool stopped);

 private:
  static void OnStart(avr_irq_t* irq, uint32_t mux, void* self);
  static void OnControl(avr_t* avr, avr_io_addr_t address, uint8_t value, void* self);
  static avr_cycle_count_t OnResult(avr_t* avr, avr_cycle_count_t when, void* self);
  uint16_t Sample(const avr_adc_mux_t& mux) const;

  avr_t* avr_;
  const Plant& plant_;
  avr_adc_t* adc_;
  uint16_t result_ = 0;
  bool stopped_ = false;
};

}  // namespace thumper
