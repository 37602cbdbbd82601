#pragma once
#include "avr.hpp"

namespace thumper {

/// Lets the watchdog reset a program that hangs with interrupts off.
///
/// In its interrupt-and-reset mode the chip resets when the interrupt was not served before the next time-out
/// (data sheet 10.9.2). simavr would raise the interrupt again, for ever. So just before that time-out the
/// interrupt is disabled, as serving it would have done, and simavr's watchdog goes on to its reset.
class WatchdogCure {
 public:
  explicit WatchdogCure(avr_t* avr) : avr_(avr), watchdog_(FindPeripheral<avr_watchdog_t>(avr, "watchdog")) {
    avr_irq_register_notify(watchdog_->watchdog.irq + AVR_INT_IRQ_PENDING, OnPending, this);
  }

 private:
  static constexpr uint64_t kBefore = 2;  // cycles before the time-out

  static void OnPending(avr_irq_t*, uint32_t pending, void* self) {
    WatchdogCure* cure = static_cast<WatchdogCure*>(self);
    if (pending != 0)
      avr_cycle_timer_register(cure->avr_, cure->watchdog_->cycle_count - kBefore, OnNextTimeOut, cure);
  }

  static avr_cycle_count_t OnNextTimeOut(avr_t* avr, avr_cycle_count_t, void* self) {
    const avr_watchdog_t* watchdog = static_cast<WatchdogCure*>(self)->watchdog_;
    if (watchdog->watchdog.pending && avr_regbit_get(avr, watchdog->wde))
      avr_regbit_clear(avr, watchdog->watchdog.enable);
    return 0;
  }

  avr_t* avr_;
  avr_watchdog_t* watchdog_;
};

}  // namespace thumper
