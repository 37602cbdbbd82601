#pragma once
#include "core/messages.hpp"

namespace reset {

/// Why the board started. The flags are read, and the watchdog switched off, before main and before the C
/// runtime.
fw::ResetCause Cause();

/// Start again from address 0 without the boot loader; Cause() will then be WATCHDOG. Interrupts must be off.
/// Every register that matters is set anew on the way to main.
[[noreturn]] void Restart();

}  // namespace reset
