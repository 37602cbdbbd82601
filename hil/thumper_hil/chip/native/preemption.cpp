#include "preemption.hpp"

#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "input_pin.hpp"

namespace thumper {
namespace {

constexpr int kTickVector = 11, kReceiveVector = 18, kPinChange0 = 3, kPinChange2 = 5;
constexpr int kTonePulseVector = 15, kSendVector = 19, kAnalogueVector = 21, kTwoWireVector = 24;
constexpr uint16_t kPort[2] = {reg::kPortD, reg::kPortB};
constexpr int kDirectionBit = 2;       // of both ports on the T'REX
constexpr int kPwmBit = 3;             // likewise
constexpr int kOutputBit[2] = {5, 7};  // in TCCR2A

}  // namespace

PreemptionSweep::PreemptionSweep(Chip& chip, const WatchedMemory& watched)
    : chip_(chip), avr_(chip.avr()), watched_(watched) {
  for (int i = 0; i < avr_->interrupts.vector_count; ++i)
    avr_irq_register_notify(avr_->interrupts.vector[i]->irq + AVR_INT_IRQ_RUNNING, OnRunning, this);
  for (int side = 0; side < 2; ++side) {
    forward_[side] = (avr_->data[kPort[side]] >> kDirectionBit & 1) != 0;
    driven_[side] = (avr_->data[reg::kTccr2A] >> kOutputBit[side] & 1) != 0;
    now_.shortest_rest[side] = UINT64_MAX;
  }
}

PreemptionSweep::~PreemptionSweep() {
  for (int i = 0; i < avr_->interrupts.vector_count; ++i)
    avr_irq_unregister_notify(avr_->interrupts.vector[i]->irq + AVR_INT_IRQ_RUNNING, OnRunning, this);
}

void PreemptionSweep::OnRunning(avr_irq_t* irq, uint32_t running, void* self) {
  PreemptionSweep* sweep = static_cast<PreemptionSweep*>(self);
  sweep->depth_ += running != 0 ? 1 : -1;
  const avr_int_vector_t* tick = nullptr;
  for (int i = 0; i < sweep->avr_->interrupts.vector_count; ++i)
    if (sweep->avr_->interrupts.vector[i]->vector == kTickVector) tick = sweep->avr_->interrupts.vector[i];
  if (tick == nullptr || tick->irq + AVR_INT_IRQ_RUNNING != irq) return;
  Branch& now = sweep->now_;
  const uint8_t* data = sweep->avr_->data;
  const WatchedMemory& watched = sweep->watched_;
  if (running != 0) {
    if (now.ticks < Branch::kTicks)
      std::memcpy(now.entry[now.ticks], data + watched.at_entry, watched.entry_size);
  } else {
    if (now.ticks < Branch::kTicks)
      std::memcpy(now.exit[now.ticks], data + watched.at_exit, watched.exit_size);
    ++now.ticks;
  }
}

/// Run one instruction, or to the next event while the chip sleeps. Return false if the firmware crashed.
bool PreemptionSweep::Step() {
  avr_->run_cycle_limit = 1;
  avr_->run_cycle_count = 1;
  const int state = avr_run(avr_);
  Track();
  return state != cpu_Crashed && state != cpu_Stopped && state != cpu_Done;
}

void PreemptionSweep::Track() {
  for (int side = 0; side < 2; ++side) {
    const bool forward = (avr_->data[kPort[side]] >> kDirectionBit & 1) != 0;
    const bool driven = (avr_->data[reg::kTccr2A] >> kOutputBit[side] & 1) != 0;
    uint64_t& shortest = now_.shortest_rest[side];
    if (forward != forward_[side]) {
      turned_[side] = avr_->cycle;
      if (driven) shortest = 0;
    }
    if (driven && !driven_[side] && turned_[side] != 0)
      shortest = std::min<uint64_t>(shortest, avr_->cycle - turned_[side]);
    forward_[side] = forward;
    driven_[side] = driven;
    const bool high = !driven && (avr_->data[kPort[side]] >> kPwmBit & 1) != 0;
    uint64_t& since = high_since_[side];
    if (high && since == 0) since = avr_->cycle;
    if (high) now_.longest_pulse[side] = std::max<uint64_t>(now_.longest_pulse[side], avr_->cycle - since);
    if (!high) since = 0;
  }
}

/// Begin a new record with the last tick's samples and the frame that is arriving.
void PreemptionSweep::Forget() {
  uint64_t cycle;
  uint8_t byte;
  now_.byte_count = 0;
  while (chip_.uart().Receive(&byte, &cycle, 1) > 0) {
    if (byte == 0) {
      now_.byte_count = 0;
    } else if (now_.byte_count < Branch::kBytes) {
      now_.bytes[now_.byte_count++] = byte;
    }
  }
  now_.ticks = 1;
  std::memcpy(now_.entry[0], avr_->data + watched_.at_entry, watched_.entry_size);
  std::memcpy(now_.exit[0], avr_->data + watched_.at_exit, watched_.exit_size);
}

/// Return whose cycle timers end what this interrupt reports; none for the other interrupts.
std::vector<void*> PreemptionSweep::OwnersOf(int vector) const {
  switch (vector) {
    case kSendVector:
      return {FindPeripheral<avr_uart_t>(avr_, "uart")};
    case kAnalogueVector:
      return {FindPeripheral<avr_adc_t>(avr_, "adc"), chip_.adc()};
    case kTwoWireVector:
      return {&chip_.twi()};
    default:
      return {};
  }
}

/// Return whether this interrupt can occur now.
bool PreemptionSweep::CanForce(int vector) const {
  const std::vector<void*> owners = OwnersOf(vector);
  if (owners.empty() && vector != kTonePulseVector) return true;
  bool enabled = false;
  for (int i = 0; i < avr_->interrupts.vector_count; ++i) {
    const avr_int_vector_t* candidate = avr_->interrupts.vector[i];
    if (candidate->vector == vector) enabled = avr_regbit_get(avr_, candidate->enable) != 0;
  }
  if (!enabled || owners.empty()) return enabled;
  if (vector == kSendVector && static_cast<avr_uart_t*>(owners[0])->tx_cnt == 0) return false;
  for (auto* slot = avr_->cycle_timers.timer; slot != nullptr; slot = slot->next)
    if (std::find(owners.begin(), owners.end(), slot->param) != owners.end()) return true;
  return false;
}

/// Let the byte or conversion that is under way end now.
void PreemptionSweep::EndEarly(int vector) {
  const std::vector<void*> owners = OwnersOf(vector);
  std::vector<std::pair<avr_cycle_timer_t, void*>> timers;
  for (auto* slot = avr_->cycle_timers.timer; slot != nullptr; slot = slot->next)
    if (std::find(owners.begin(), owners.end(), slot->param) != owners.end())
      timers.emplace_back(slot->timer, slot->param);
  for (const auto& [timer, owner] : timers) {
    avr_cycle_timer_cancel(avr_, timer, owner);
    avr_cycle_timer_register(avr_, 1, timer, owner);
  }
}

void PreemptionSweep::Force(int vector, char port, int bit, const uint8_t* frame, std::size_t frame_size) {
  if (vector == kPinChange0 || vector == kPinChange2) {
    avr_ioport_t* pins = FindPeripheral<avr_ioport_t>(avr_, "port", port);
    DriveInput(pins, bit, (avr_->data[pins->r_pin] >> bit & 1) == 0);
  } else if (vector == kReceiveVector) {
    chip_.uart().Arrive(frame[0]);
    chip_.uart().Send(frame + 1, frame_size - 1);
  } else if (!OwnersOf(vector).empty()) {
    EndEarly(vector);
  } else {
    for (int i = 0; i < avr_->interrupts.vector_count; ++i)
      if (avr_->interrupts.vector[i]->vector == vector) avr_raise_interrupt(avr_, avr_->interrupts.vector[i]);
  }
}

int PreemptionSweep::Run(uint64_t until_cycle, int vector, char port, int bit, const uint8_t* frame,
                         std::size_t frame_size, uint64_t tail_cycles, int stride, int per_address,
                         const uint8_t* skip, Branch* branches, std::size_t capacity) {
  void* const memory =
      mmap(nullptr, sizeof(Branch), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) return -1;
  Branch* const shared = static_cast<Branch*>(memory);
  const avr_cycle_count_t limit = avr_->run_cycle_limit;
  while (avr_->interrupts.running_ptr != 0 && Step()) {  // begin in no interrupt
  }
  depth_ = 0;
  std::size_t count = 0;
  int instruction = 0;
  std::vector<int> visits(avr_->flashend + 1);
  while (avr_->cycle < until_cycle && count < capacity) {
    const bool in_main_loop = depth_ == 0 && avr_->state == cpu_Running;
    const bool line_is_free = vector != kReceiveVector || chip_.uart().idle();
    const bool wanted =
        per_address == 0 || (line_is_free && visits[avr_->pc] < per_address && skip[avr_->pc] == 0);
    if (in_main_loop && wanted && CanForce(vector) && instruction++ % stride == 0) {
      ++visits[avr_->pc];
      *shared = {};
      shared->crashed = 1;  // unless the branch ends normally
      const pid_t child = fork();
      if (child < 0) return -1;
      if (child == 0) {
        now_.cycle = avr_->cycle;
        now_.address = avr_->pc;
        if (per_address > 0) Forget();
        Force(vector, port, bit, frame, frame_size);
        const uint64_t end = avr_->cycle + tail_cycles;
        bool alive = true;
        while (alive && avr_->cycle < end) alive = Step();
        uint64_t cycles[Branch::kBytes];
        now_.byte_count += static_cast<uint32_t>(
            chip_.uart().Receive(now_.bytes + now_.byte_count, cycles, Branch::kBytes - now_.byte_count));
        now_.crashed = alive ? 0 : 1;
        *shared = now_;
        _exit(0);
      }
      waitpid(child, nullptr, 0);
      branches[count++] = *shared;
    }
    if (!Step()) break;
  }
  avr_->run_cycle_limit = limit;
  munmap(memory, sizeof(Branch));
  return static_cast<int>(count);
}

}  // namespace thumper
