#include "chip.hpp"

#include <algorithm>
#include <cstdarg>
#include <cstdlib>
#include <stdexcept>
#include <vector>

#include "elf_image.hpp"
#include "programmer.hpp"

namespace thumper {
namespace {

/// simavr only logs an invalid opcode and continues. It has one logger for all chips.
void StopAtInvalidOpcode(avr_t* avr, const int, const char* format, va_list) {
  if (avr != nullptr && std::strstr(format, "Invalid Opcode") != nullptr) avr->state = cpu_Crashed;
}

/// simavr has no phase-correct PWM: such a timer overflows on every tick, which takes most of the run time.
/// Make it overflow every 512 ticks instead (the chip: 510). The plant reads the duty from the registers.
void FixPhaseCorrectPwm(avr_t* avr) {
  constexpr int kPhaseCorrect = 1;
  for (const char name : {'0', '2'}) {
    avr_timer_wgm_t& mode = FindPeripheral<avr_timer_t>(avr, "timer", name)->wgm_op[kPhaseCorrect];
    mode.kind = avr_timer_wgm_normal;
    mode.size = 9;  // bits
  }
}

/// End simavr's chip, and free what simavr 1.6 keeps: names and listeners of the interrupts and registers,
/// and its list of them. That is 8 kB for each chip.
void Free(avr_t* avr) {
  constexpr uint32_t kPerRegister = 9;  // one for each bit, one for the byte
  for (const auto& io : avr->io) avr_free_irq(io.irq, kPerRegister);
  avr_terminate(avr);
  for (int i = 0; i < avr->irq_pool.count; ++i) avr_free_irq(avr->irq_pool.irq[i], 1);
  std::free(avr->irq_pool.irq);
  std::free(avr);
}

avr_cycle_count_t StopHere(avr_t*, avr_cycle_count_t, void*) { return 0; }

}  // namespace

Chip::Chip(const std::string& elf_path, const PlantParams* plant_params, const Wiring& wiring,
           uint64_t seed) {
  avr_global_logger_set(StopAtInvalidOpcode);
  avr_ = avr_make_mcu_by_name("atmega328p");
  if (avr_ == nullptr) throw std::runtime_error("this libsimavr does not support the atmega328p");
  avr_init(avr_);
  LoadFirmware(elf_path);
  avr_->frequency = kCpuHz;
  avr_->vcc = avr_->avcc = avr_->aref = 5000;
  avr_->sleep = OnSleep;
  avr_->custom.data = this;

  FixPhaseCorrectPwm(avr_);
  uart_.emplace(avr_, seed);
  watchdog_.emplace(avr_);
  eeprom_.emplace(avr_);
  if (plant_params != nullptr) {
    plant_.emplace(avr_, *plant_params, wiring, seed);
    adc_.emplace(avr_, *plant_);
  }
  twi_.emplace(avr_, plant(), seed);
  for (const uint16_t mask : {reg::kTimsk0, reg::kTimsk1})
    avr_register_io_write(avr_, mask, OnTimerMask, this);
  for (int i = 0; i < avr_->interrupts.vector_count; ++i) {
    avr_int_vector_t* vector = avr_->interrupts.vector[i];
    avr_irq_register_notify(vector->irq + AVR_INT_IRQ_RUNNING, OnInterrupt, this);
  }
  const avr_uart_t* uart = FindPeripheral<avr_uart_t>(avr_, "uart");
  avr_irq_register_notify(avr_get_interrupt_irq(avr_, uart->rxc.vector) + AVR_INT_IRQ_RUNNING,
                          OnReceiveInterrupt, this);

  // Last in simavr's list, so it runs after the reset of all peripherals.
  reset_hook_.io.kind = "thumper";
  reset_hook_.io.avr = avr_;
  reset_hook_.io.reset = OnReset;
  reset_hook_.chip = this;
  avr_io_t* last = avr_->io_port;
  while (last->next != nullptr) last = last->next;
  last->next = &reset_hook_.io;
  Rearm();
}

Chip::~Chip() { Free(avr_); }

void Chip::LoadFirmware(const std::string& elf_path) {
  const ElfImage image = ReadElf(elf_path, avr_->flashend + 1);
  for (const ElfImage::Segment& segment : image.segments)
    std::copy(segment.bytes.begin(), segment.bytes.end(), avr_->flash + segment.address);
  avr_->codeend = image.code_end;
}

void Chip::Rearm() {
  avr_->run_cycle_limit = kCyclesPerMs;  // otherwise one instruction per call
  // D2 and D3 are INT0 and INT1. While they are low, simavr polls them on every cycle for level interrupts.
  avr_extint_set_strict_lvl_trig(avr_, EXTINT_IRQ_OUT_INT0, 0);
  avr_extint_set_strict_lvl_trig(avr_, EXTINT_IRQ_OUT_INT1, 0);
  uart_->Rearm();
  if (plant_) plant_->Rearm();
  if (twi_) twi_->Rearm();
}

void Chip::OnReset(avr_io_t* io) {
  Chip* chip = reinterpret_cast<ResetHook*>(io)->chip;
  ++chip->resets_;
  chip->Rearm();
}

void Chip::Reset() {
  // SRAM survives a reset on the chip, but simavr clears it.
  uint8_t* const sram = avr_->data + avr_->ioend + 1;
  const std::vector<uint8_t> kept(sram, avr_->data + avr_->ramend + 1);
  avr_reset(avr_);
  std::copy(kept.begin(), kept.end(), sram);
  avr_regbit_set(avr_, avr_->reset_flags.extrf);  // simavr leaves MCUSR empty
}

void Chip::Hang(bool interrupts_off) {
  constexpr uint32_t kTrap = 0x6FFE;  // below every boot loader, above this firmware
  constexpr uint8_t kJumpToItself[2] = {0xFF, 0xCF};
  Programmer(avr_).WriteFlash(kTrap, kJumpToItself, sizeof kJumpToItself);
  if (interrupts_off) avr_->sreg[S_I] = 0;
  if (avr_->state == cpu_Sleeping) avr_->state = cpu_Running;
  avr_->pc = kTrap;
}

/// simavr calls this before it jumps to the next timer. Its default version waits in real time.
void Chip::OnSleep(avr_t* avr, avr_cycle_count_t how_long) {
  static_cast<Chip*>(avr->custom.data)->slept_cycles_ += how_long + 1;
}

/// An interrupt that is enabled while its flag is set runs at once. simavr would forget it.
void Chip::OnTimerMask(avr_t* avr, avr_io_addr_t address, uint8_t value, void*) {
  avr->data[address] = value;
  for (int i = 0; i < avr->interrupts.vector_count; ++i) {
    avr_int_vector_t* vector = avr->interrupts.vector[i];
    if (vector->enable.reg == address && avr_regbit_get(avr, vector->enable) && !vector->pending &&
        avr_regbit_get(avr, vector->raised))
      avr_raise_interrupt(avr, vector);
  }
}

/// The chip takes four cycles from interrupt to vector (data sheet 7.7.1), simavr none.
void Chip::OnInterrupt(avr_irq_t*, uint32_t running, void* self) {
  constexpr uint64_t kResponse = 4;
  if (running == 0) return;
  avr_t* avr = static_cast<Chip*>(self)->avr_;
  avr->cycle += kResponse;
  avr->run_cycle_count = avr->run_cycle_count > kResponse ? avr->run_cycle_count - kResponse : 1;
}

void Chip::OnReceiveInterrupt(avr_irq_t*, uint32_t running, void* self) {
  if (running == 0) static_cast<Chip*>(self)->uart_->OnReceiveDone();
}

RunStatus Chip::Run(uint64_t until_cycle, std::size_t bytes_wanted) {
  if (bytes_wanted == 0) return RunTo(until_cycle);
  while (avr_->cycle < until_cycle) {
    const uint64_t next_poll = (avr_->cycle / kCyclesPerMs + 1) * kCyclesPerMs;
    const RunStatus status = RunTo(std::min(next_poll, until_cycle));
    if (status != RunStatus::kTimeReached) return status;
    if (uart_->Available() >= bytes_wanted) return RunStatus::kBytesReady;
  }
  return RunStatus::kTimeReached;
}

RunStatus Chip::RunTo(uint64_t until_cycle) {
  if (avr_->cycle >= until_cycle) return RunStatus::kTimeReached;
  avr_cycle_timer_register(avr_, until_cycle - avr_->cycle, StopHere, nullptr);
  while (avr_->cycle < until_cycle) {
    const int state = avr_run(avr_);
    if (state == cpu_Crashed || state == cpu_Stopped) return RunStatus::kCrashed;
    if (state == cpu_Done) return RunStatus::kAsleepForEver;
  }
  return RunStatus::kTimeReached;
}

}  // namespace thumper
