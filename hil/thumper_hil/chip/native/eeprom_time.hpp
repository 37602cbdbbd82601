#pragma once
#include "avr.hpp"

namespace thumper {

/// Lets an EEPROM write take 3.4 ms, during which EEPE reads 1 and another write or a read has no effect.
///
/// simavr writes at once and clears EEPE in the same instruction. This class wraps its handler of the control
/// register.
class EepromTime {
 public:
  explicit EepromTime(avr_t* avr) {
    auto& handler = avr->io[AVR_DATA_TO_IO(reg::kEecr)].w;
    simavrs_ = handler.c;
    param_ = handler.param;
    handler = {this, OnControl};
  }

 private:
  static constexpr uint8_t kRead = 1u << 0, kWrite = 1u << 1, kEnable = 1u << 2;  // EERE, EEPE, EEMPE
  static constexpr uint64_t kWriteCycles = kCpuHz * 34ULL / 10'000;               // 3.4 ms (data sheet)

  static void OnControl(avr_t* avr, avr_io_addr_t address, uint8_t value, void* self) {
    const EepromTime* eeprom = static_cast<EepromTime*>(self);
    uint8_t& control = avr->data[address];
    const bool busy = (control & kWrite) != 0;
    const bool starts = !busy && (control & kEnable) != 0 && (value & kWrite) != 0;
    if (busy) value &= static_cast<uint8_t>(~(kRead | kWrite));
    eeprom->simavrs_(avr, address, value, eeprom->param_);
    if (busy || starts) control |= kWrite;
    if (starts) avr_cycle_timer_register(avr, kWriteCycles, OnEnd, nullptr);
  }

  static avr_cycle_count_t OnEnd(avr_t* avr, avr_cycle_count_t, void*) {
    avr->data[reg::kEecr] &= static_cast<uint8_t>(~kWrite);
    return 0;
  }

  avr_io_write_t simavrs_;
  void* param_;
};

}  // namespace thumper
