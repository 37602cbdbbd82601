#include "board/reset.hpp"

#include <avr/io.h>
#include <avr/wdt.h>

namespace {
constexpr uint16_t kRestarted = 0x57A6;
// SRAM keeps these through a restart. After power-on they are random, so the marker is a pattern.
uint8_t flags __attribute__((section(".noinit")));
uint16_t mark __attribute__((section(".noinit")));
// The latched fault, XORed with the schema hash to detect random content and other firmware.
uint32_t kept __attribute__((section(".noinit")));
}  // namespace

/// After a watchdog reset the watchdog keeps running at 16 ms. Stop it before .data and .bss are set up.
extern "C" void SaveResetCause() __attribute__((naked, used, section(".init3")));
extern "C" void SaveResetCause() {
  flags = MCUSR;
  MCUSR = 0;
  wdt_disable();
}

namespace reset {

fw::ResetCause Cause() {
  const bool restarted = mark == kRestarted;
  mark = 0;
  if ((flags & 1 << PORF) != 0) return fw::ResetCause::kPowerOn;  // power-on may set the others too
  if ((flags & 1 << BORF) != 0) return fw::ResetCause::kBrownOut;
  if (restarted || (flags & 1 << WDRF) != 0) return fw::ResetCause::kWatchdog;
  if ((flags & 1 << EXTRF) != 0) return fw::ResetCause::kExternal;
  return fw::ResetCause::kUnknown;
}

void Keep(fw::Fault fault) { kept = fw::kSchemaHash ^ static_cast<uint8_t>(fault); }

fw::Fault Kept() {
  const uint32_t fault = kept ^ fw::kSchemaHash;
  const bool valid = fault < fw::kFaultCount && (flags & 1 << PORF) == 0;
  return valid ? static_cast<fw::Fault>(fault) : fw::Fault::kNone;
}

void Restart() {
  mark = kRestarted;
  asm volatile("jmp 0");
  __builtin_unreachable();
}

}  // namespace reset
