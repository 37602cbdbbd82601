#pragma once
// Only this file includes libsimavr's headers: they are C and cause warnings under this project's flags.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpedantic"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#pragma GCC diagnostic ignored "-Wsign-compare"
extern "C" {
#include <simavr/avr_adc.h>
#include <simavr/avr_eeprom.h>
#include <simavr/avr_extint.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_timer.h>
#include <simavr/avr_twi.h>
#include <simavr/avr_uart.h>
#include <simavr/avr_watchdog.h>
#include <simavr/sim_avr.h>
}
#pragma GCC diagnostic pop

#include <cstdint>
#include <cstring>

namespace thumper {

constexpr uint32_t kCpuHz = 16'000'000;
constexpr uint64_t kCyclesPerMs = kCpuHz / 1000;

/// Register addresses in the data space of the ATmega328P (data sheet, register summary).
namespace reg {
constexpr uint16_t kPinB = 0x23, kDdrB = 0x24, kPortB = 0x25;
constexpr uint16_t kDdrC = 0x27, kPortC = 0x28;
constexpr uint16_t kPinD = 0x29, kDdrD = 0x2A, kPortD = 0x2B;
constexpr uint16_t kEecr = 0x3F;
constexpr uint16_t kAdcL = 0x78, kAdcH = 0x79, kAdcsrA = 0x7A, kAdmux = 0x7C;
constexpr uint16_t kTimsk0 = 0x6E, kTimsk1 = 0x6F;
constexpr uint16_t kTccr2A = 0xB0, kTccr2B = 0xB1, kOcr2A = 0xB3, kOcr2B = 0xB4;
constexpr uint16_t kTwbr = 0xB8, kTwsr = 0xB9, kTwdr = 0xBB, kTwcr = 0xBC;
constexpr uint16_t kUcsr0A = 0xC0, kUbrr0L = 0xC4, kUbrr0H = 0xC5;
}  // namespace reg

/// Return the peripheral of this kind, or null. `name` selects a port ('B', 'C', 'D') or a timer ('0', '1',
/// '2').
template <typename Peripheral>
Peripheral* FindPeripheral(avr_t* avr, const char* kind, char name = 0) {
  for (avr_io_t* io = avr->io_port; io != nullptr; io = io->next) {
    if (std::strcmp(io->kind, kind) != 0) continue;
    // Every simavr peripheral starts with its avr_io_t; in ports and timers the name follows it.
    if (name != 0 && reinterpret_cast<avr_ioport_t*>(io)->name != name) continue;
    return reinterpret_cast<Peripheral*>(io);
  }
  return nullptr;
}

}  // namespace thumper
