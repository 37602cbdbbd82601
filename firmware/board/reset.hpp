#pragma once
#include "core/messages.hpp"

namespace reset {

/// Return why the board started. The flags are read, and the watchdog stopped, before the C runtime starts.
fw::ResetCause Cause();

/// Store the latched fault where it survives a restart or a reset (opening the port causes one). Only
/// power-on clears it.
void Keep(fw::Fault fault);

/// Return the stored fault; NONE after power-on. Call after Cause().
fw::Fault Kept();

/// Restart from address 0 without the boot loader; Cause() then returns WATCHDOG. Call with interrupts off.
/// Startup initializes every register that matters before main.
[[noreturn]] void Restart();

}  // namespace reset
