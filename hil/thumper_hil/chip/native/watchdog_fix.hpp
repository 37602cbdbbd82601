#pragma once
#include "avr.hpp"

namespace thumper {

/// Lets the watchdog reset a program that hangs with interrupts off.
///
/// In interrupt-and-reset mode the chip resets if the interrupt was not served before the next time-out (data
/// sheet 10.9.2). simavr would raise the interrupt again, for ever. So just before that time-out, this class
/// disables the interrupt, as serving it would have done. simavr's watchdog then resets the chip.
class WatchdogFix {
 public:
  explicit WatchdogFix(avr_t* avr) : avr_(avr), watchdog_(FindPeripheral<avr_watchdog_t>(avr, "watchdog")) {
    avr_irq_register_notify(watchdog_->watchdog.irq + AVR_INT_IRQ_PENDING, OnPending, this);
  }

 private:
  static constexpr uint64_t kBefore = 2;  // cycles before the time-out

  static void OnPending(avr_irq_t*, uint32_t pending, void* self) {
    WatchdogFix* fix = static_cast<WatchdogFix*>(self);
    if (pending != 0)
      avr_cycle_timer_register(fix->avr_, fix->watchdog_->cycle_count - kBefore, OnNextTimeOut, fix);
  }

  static avr_cycle_count_t OnNextTimeOut(avr_t* avr, avr_cycle_count_t, void* self) {
    const avr_watchdog_t* watchdog = static_cast<WatchdogFix*>(self)->watchdog_;
    if (watchdog->watchdog.pending && avr_regbit_get(avr, watchdog->wde))
      avr_regbit_clear(avr, watchdog->watchdog.enable);
    return 0;
  }

  avr_t* avr_;
  avr_watchdog_t* watchdog_;
};

}  // namespace thumper
