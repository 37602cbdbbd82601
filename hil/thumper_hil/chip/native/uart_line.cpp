#include "uart_line.hpp"

#include <algorithm>
#include <cmath>

namespace thumper {
namespace {

constexpr uint32_t kBitsPerByte = 10;  // start, eight data, stop
constexpr int kReceiveDepth = 3;       // two in the buffer, one in the shift register (data sheet 19.7)

/// Return what a receiver at another baud rate reads: a different byte.
uint8_t Garble(uint8_t byte) { return static_cast<uint8_t>(byte * 0x9Du ^ 0xA5u); }

int FifoSize(const avr_uart_t* uart) {
  constexpr int kFifoSize = 64;
  return (uart->input.write + kFifoSize - uart->input.read) % kFifoSize;
}

}  // namespace

// Separate from the motor noise of the same seed.
UartLine::UartLine(avr_t* avr, uint64_t seed)
    : avr_(avr), uart_(FindPeripheral<avr_uart_t>(avr, "uart")), random_(seed ^ 0x5E71A1) {
  uart_->flags = 0;  // no copy to stdout, no sleeping in real time
  avr_irq_register_notify(uart_->io.irq + UART_IRQ_OUTPUT, OnTransmit, this);
}

void UartLine::Rearm() {
  line_free_cycle_ = avr_->cycle;
  if (!to_chip_.empty()) avr_cycle_timer_register(avr_, CyclesPerByte(), OnByteTime, this);
}

uint32_t UartLine::CyclesPerByte() const {
  const uint32_t ubrr = avr_->data[reg::kUbrr0L] | ((avr_->data[reg::kUbrr0H] & 0x0Fu) << 8);
  constexpr uint8_t kDoubleSpeed = 1u << 1;
  const uint32_t cycles_per_tick = (avr_->data[reg::kUcsr0A] & kDoubleSpeed) != 0 ? 8 : 16;
  return kBitsPerByte * (ubrr + 1) * cycles_per_tick;
}

bool UartLine::SameBaud() const {
  if (host_baud_ == 0) return true;
  constexpr double kTolerance = 0.04;  // half a bit in ten, less the sampling error
  const double chip_baud = static_cast<double>(kBitsPerByte) * kCpuHz / CyclesPerByte();
  return std::abs(chip_baud / host_baud_ - 1.0) < kTolerance;
}

/// Apply noise to a byte. Return false if the byte is lost.
bool UartLine::SurvivesNoise(uint8_t& byte) {
  if (loss_ == 0.0 && flip_ == 0.0) return true;
  if (random_.Uniform() < loss_) return false;
  constexpr int kBits = 8;
  if (random_.Uniform() < flip_)
    byte ^= static_cast<uint8_t>(1u << static_cast<int>(random_.Uniform() * kBits));
  return true;
}

void UartLine::Send(const uint8_t* data, std::size_t count) {
  const bool idle = to_chip_.empty();
  to_chip_.insert(to_chip_.end(), data, data + count);
  if (idle && count > 0) avr_cycle_timer_register(avr_, CyclesPerByte(), OnByteTime, this);
}

void UartLine::Arrive(uint8_t byte) {
  if (FifoSize(uart_) >= kReceiveDepth) {
    ++overruns_;
    avr_regbit_set(avr_, uart_->dor);
    return;
  }
  // simavr starts its own byte time here. The byte has already arrived, so set that time to one cycle.
  uart_->cycles_per_byte = 1;
  avr_raise_irq(uart_->io.irq + UART_IRQ_INPUT,
                SameBaud() ? byte : static_cast<uint32_t>(Garble(byte)) | UART_INPUT_FE);
  uart_->cycles_per_byte = CyclesPerByte();
}

avr_cycle_count_t UartLine::OnByteTime(avr_t*, avr_cycle_count_t when, void* self) {
  UartLine* line = static_cast<UartLine*>(self);
  uint8_t byte = line->to_chip_.front();
  line->to_chip_.pop_front();
  const uint32_t cycles_per_byte = line->CyclesPerByte();
  if (line->SurvivesNoise(byte)) line->Arrive(byte);
  return line->to_chip_.empty() ? 0 : when + cycles_per_byte;
}

void UartLine::OnReceiveDone() {
  // The chip enters the handler again while bytes wait; simavr would do so only a byte time later.
  if (FifoSize(uart_) > 0) avr_raise_interrupt(avr_, &uart_->rxc);
}

void UartLine::OnTransmit(avr_irq_t*, uint32_t byte, void* self) {
  UartLine* line = static_cast<UartLine*>(self);
  line->uart_->cycles_per_byte = line->CyclesPerByte();
  line->line_free_cycle_ =
      std::max<uint64_t>(line->line_free_cycle_, line->avr_->cycle) + line->CyclesPerByte();
  uint8_t sent = static_cast<uint8_t>(byte);
  if (!line->SurvivesNoise(sent)) return;
  line->from_chip_.push_back({line->line_free_cycle_, line->SameBaud() ? sent : Garble(sent)});
}

std::size_t UartLine::Available() const {
  const auto after_now = [](uint64_t cycle, const Arrival& arrival) { return cycle < arrival.cycle; };
  const auto end = std::upper_bound(from_chip_.begin(), from_chip_.end(), avr_->cycle, after_now);
  return static_cast<std::size_t>(end - from_chip_.begin());
}

std::size_t UartLine::Receive(uint8_t* data, uint64_t* cycles, std::size_t capacity) {
  const std::size_t count = std::min(capacity, Available());
  for (std::size_t i = 0; i < count; ++i) {
    data[i] = from_chip_[i].byte;
    cycles[i] = from_chip_[i].cycle;
  }
  from_chip_.erase(from_chip_.begin(), from_chip_.begin() + static_cast<std::ptrdiff_t>(count));
  return count;
}

}  // namespace thumper
