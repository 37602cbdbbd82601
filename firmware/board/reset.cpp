#include "board/reset.hpp"

#include <avr/io.h>
#include <avr/wdt.h>

namespace {
constexpr uint16_t kRestarted = 0x57A6;
// SRAM keeps them through a restart. After power-on they hold anything, hence a pattern.
uint8_t flags __attribute__((section(".noinit")));
uint16_t mark __attribute__((section(".noinit")));
// The latched fault, and what tells it from rubbish: the fault both ways, over the schema's hash, so that
// another firmware's fault is not taken for ours.
uint8_t kept __attribute__((section(".noinit")));
uint16_t kept_check __attribute__((section(".noinit")));

uint16_t Check(uint8_t fault) {
  return static_cast<uint16_t>(fw::kSchemaHash) ^ static_cast<uint16_t>(fault << 8 | (fault ^ 0xFF));
}
}  // namespace

/// After a watchdog reset the watchdog runs on at 16 ms: stop it before .data and .bss are set up.
extern "C" void SaveResetCause() __attribute__((naked, used, section(".init3")));
extern "C" void SaveResetCause() {
  flags = MCUSR;
  MCUSR = 0;
  wdt_disable();
}

namespace reset {

fw::ResetCause Cause() {
  const bool restarted = mark == kRestarted && (flags & (1 << PORF | 1 << EXTRF | 1 << BORF)) == 0;
  mark = 0;
  if ((flags & 1 << PORF) != 0) return fw::ResetCause::kPowerOn;  // power-on may raise the others too
  if ((flags & 1 << BORF) != 0) return fw::ResetCause::kBrownOut;
  if (restarted || (flags & 1 << WDRF) != 0) return fw::ResetCause::kWatchdog;
  if ((flags & 1 << EXTRF) != 0) return fw::ResetCause::kExternal;
  return fw::ResetCause::kUnknown;
}

void Keep(fw::Fault fault) {
  kept = static_cast<uint8_t>(fault);
  kept_check = Check(kept);
}

fw::Fault Kept() {
  const bool ours = kept < fw::kFaultCount && kept_check == Check(kept) && (flags & 1 << PORF) == 0;
  return ours ? static_cast<fw::Fault>(kept) : fw::Fault::kNone;
}

void Restart() {
  mark = kRestarted;
  asm volatile("jmp 0");
  __builtin_unreachable();
}

}  // namespace reset
