#include "board/reset.hpp"

#include <avr/io.h>
#include <avr/wdt.h>

namespace {
uint8_t flags __attribute__((section(".noinit")));
}  // namespace

/// After a watchdog reset the watchdog runs on at 16 ms: stop it before .data and .bss are set up.
extern "C" void SaveResetCause() __attribute__((naked, used, section(".init3")));
extern "C" void SaveResetCause() {
  flags = MCUSR;
  MCUSR = 0;
  wdt_disable();
}

fw::ResetCause ReadResetCause() {
  if ((flags & 1 << PORF) != 0) return fw::ResetCause::kPowerOn;  // power-on may raise the others too
  if ((flags & 1 << BORF) != 0) return fw::ResetCause::kBrownOut;
  if ((flags & 1 << WDRF) != 0) return fw::ResetCause::kWatchdog;
  if ((flags & 1 << EXTRF) != 0) return fw::ResetCause::kExternal;
  return fw::ResetCause::kUnknown;
}
