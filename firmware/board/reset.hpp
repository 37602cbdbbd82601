#pragma once
#include "core/messages.hpp"

namespace reset {

/// Why the board started. The flags are read, and the watchdog switched off, before main and before the C
/// runtime.
fw::ResetCause Cause();

/// Keep the latched fault through a restart or a reset (opening the port makes one): a board must not forget
/// why it stopped. Only power-on does.
void Keep(fw::Fault fault);

/// The fault that was kept; NONE after power-on. After Cause().
fw::Fault Kept();

/// Start again from address 0 without the boot loader; Cause() will then be WATCHDOG. Interrupts must be off.
/// Every register that matters is set anew on the way to main.
[[noreturn]] void Restart();

}  // namespace reset
