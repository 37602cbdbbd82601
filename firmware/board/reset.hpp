#pragma once
#include "core/messages.hpp"

/// Why the board started. The flags are read, and the watchdog switched off, before main and before the C
/// runtime.
fw::ResetCause ReadResetCause();
