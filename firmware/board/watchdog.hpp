#pragma once
#include <avr/io.h>
#include <avr/wdt.h>

/// The watchdog in its interrupt-then-reset mode, 250 ms.
///
/// A plain watchdog reset never comes back from the stock boot loader, which leaves the watchdog on and loops
/// for ever. So its interrupt stops the motors and restarts the program itself (reset.hpp). Only when that
/// interrupt cannot run (a hang with interrupts off) the next time-out resets the chip: its pins float, the
/// motors are off, and with the stock boot loader the board must be switched off and on.
namespace watchdog {

inline void Start() {
  wdt_reset();
  WDTCSR = 1 << WDCE | 1 << WDE;  // opens a window of four cycles
  WDTCSR = 1 << WDIE | 1 << WDE | 1 << WDP2;
}

/// Once a control tick, from the main loop, if milliseconds have passed since the last one: then tick,
/// millisecond, main loop and interrupts are all alive.
inline void Kick() { wdt_reset(); }

}  // namespace watchdog
