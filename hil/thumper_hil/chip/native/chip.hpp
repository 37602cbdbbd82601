#pragma once
#include <memory>
#include <optional>
#include <string>

#include "adc_latch.hpp"
#include "avr.hpp"
#include "eeprom_time.hpp"
#include "plant.hpp"
#include "twi_bus.hpp"
#include "uart_line.hpp"
#include "watchdog_fix.hpp"

namespace thumper {

enum class RunStatus : int {
  kTimeReached = 0,
  kBytesReady = 1,
  kCrashed = 2,        // an invalid instruction or a jump out of the flash
  kAsleepForEver = 3,  // the firmware sleeps with interrupts off
};

/// An emulated ATmega328P at 16 MHz that runs a firmware ELF, with fixes for simavr 1.6, connected to the
/// simulated robot.
///
/// Everything that happens to the chip is a simavr cycle timer, so a sleeping chip jumps from event to event.
class Chip {
 public:
  /// Throws std::runtime_error with a one-line message if the ELF cannot be loaded.
  /// `wiring` must outlive the chip.
  Chip(const std::string& elf_path, const PlantParams* plant_params, const Wiring& wiring, uint64_t seed);
  ~Chip();
  Chip(const Chip&) = delete;
  Chip& operator=(const Chip&) = delete;

  /// Run until this cycle or, if `bytes_wanted` > 0, until this many bytes wait for the host. The host polls
  /// once per millisecond, as often as USB delivers data.
  RunStatus Run(uint64_t until_cycle, std::size_t bytes_wanted);

  void Reset();  ///< pulse the reset pin

  /// Put the program into an endless loop, like a bug. Interrupts keep running unless they are off.
  void Hang(bool interrupts_off);
  uint64_t cycle() const { return avr_->cycle; }
  uint64_t resets() const { return resets_; }
  uint64_t slept_cycles() const { return slept_cycles_; }
  uint32_t program_counter() const { return avr_->pc; }  ///< [bytes]
  uint8_t data(uint16_t address) const { return avr_->data[address]; }
  avr_t* avr() { return avr_; }  ///< for instruments (lab_api.cpp)
  UartLine& uart() { return *uart_; }
  Plant* plant() { return plant_ ? &*plant_ : nullptr; }
  TwiBus& twi() { return *twi_; }
  AdcLatch* adc() { return adc_ ? &*adc_ : nullptr; }

 private:
  struct ResetHook {
    avr_io_t io;
    Chip* chip;
  };

  static void OnReset(avr_io_t* io);
  static void OnSleep(avr_t* avr, avr_cycle_count_t how_long);
  static void OnTimerMask(avr_t* avr, avr_io_addr_t address, uint8_t value, void* self);
  static void OnInterrupt(avr_irq_t* irq, uint32_t running, void* self);
  static void OnReceiveInterrupt(avr_irq_t* irq, uint32_t running, void* self);
  RunStatus RunTo(uint64_t until_cycle);
  void LoadFirmware(const std::string& elf_path);
  void Rearm();

  avr_t* avr_ = nullptr;
  ResetHook reset_hook_{};
  std::optional<UartLine> uart_;
  std::optional<Plant> plant_;
  std::optional<AdcLatch> adc_;
  std::optional<TwiBus> twi_;
  std::optional<WatchdogFix> watchdog_;
  std::optional<EepromTime> eeprom_;
  uint64_t resets_ = 0, slept_cycles_ = 0;
};

}  // namespace thumper
