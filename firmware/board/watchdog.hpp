#pragma once
#include <avr/io.h>
#include <avr/wdt.h>

/// Watchdog in interrupt-then-reset mode, 250 ms.
///
/// The board never recovers from a plain watchdog reset: the stock boot loader leaves the watchdog running
/// and loops for ever. So the watchdog interrupt stops the motors and restarts the program itself
/// (reset.hpp). If that interrupt cannot run (a hang with interrupts off), the next time-out resets the chip.
/// Its pins then float and the motors are off. With the stock boot loader, switch the board off and on.
namespace watchdog {

inline void Start() {
  wdt_reset();
  WDTCSR = 1 << WDCE | 1 << WDE;  // opens a window of four cycles
  WDTCSR = 1 << WDIE | 1 << WDE | 1 << WDP2;
}

/// Call once per control tick from the main loop, if milliseconds have passed since the last call. Then tick,
/// millisecond, main loop and interrupts are all alive.
inline void Kick() { wdt_reset(); }

}  // namespace watchdog
