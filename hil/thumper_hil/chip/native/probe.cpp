#include "probe.hpp"

#include <algorithm>

namespace thumper {
namespace {

constexpr uint64_t kResponse = 4;  // from interrupt to vector; Chip adds them to simavr's clock
constexpr uint16_t kGpior0 = 0x3E, kSpl = 0x5D, kSph = 0x5E;

}  // namespace

Probe::Probe(avr_t* avr, int tick_vector) : avr_(avr), tick_vector_(tick_vector) {
  for (int i = 0; i < avr_->interrupts.vector_count; ++i)
    avr_irq_register_notify(avr_->interrupts.vector[i]->irq + AVR_INT_IRQ_RUNNING, OnRunning, this);
  off_ = avr_->sreg[S_I] == 0;
  off_since_ = avr_->cycle;
  for (VectorCost& cost : report_.vector) cost.least = UINT64_MAX;
  report_.tick_least = UINT64_MAX;
}

Probe::~Probe() {
  for (int i = 0; i < avr_->interrupts.vector_count; ++i)
    avr_irq_unregister_notify(avr_->interrupts.vector[i]->irq + AVR_INT_IRQ_RUNNING, OnRunning, this);
}

bool Probe::Run(uint64_t until_cycle) {
  const avr_cycle_count_t limit = avr_->run_cycle_limit;
  avr_->run_cycle_limit = 1;
  avr_->run_cycle_count = 1;
  while (avr_->cycle < until_cycle) {
    const uint64_t before = avr_->cycle;
    const uint32_t address = avr_->pc;
    const bool slept = avr_->state == cpu_Sleeping;
    const int state = avr_run(avr_);
    if (state == cpu_Crashed || state == cpu_Stopped || state == cpu_Done) return false;
    Account(slept ? avr_->cycle - (entered_ != 0 ? kResponse : 0) : before, address);
  }
  avr_->run_cycle_limit = limit;
  return true;
}

/// Account for the instruction just executed. An interrupt may have been entered after it.
void Probe::Account(uint64_t before, uint32_t address) {
  const uint64_t now = avr_->cycle;
  const uint64_t ran_until = entered_ != 0 ? now - kResponse : now;
  const bool in_main = running_.empty();
  if (leaving_) Leave(ran_until);
  report_.awake += now - before;
  if (in_main) {
    report_.main_awake += ran_until - before;
    burst_ += ran_until - before;
  }
  if (avr_->state == cpu_Sleeping) {
    if (burst_has_tick_) tick_bursts_.push_back(burst_);
    burst_has_tick_ = false;
    burst_ = 0;
  }

  const bool entered = entered_ != 0;
  if (entered) {
    if (off_) EndOff(ran_until);
    off_ = false;
    address = static_cast<uint32_t>(4 * entered_);
    Enter(entered_, ran_until);
    entered_ = 0;
  }
  const bool off = avr_->sreg[S_I] == 0;
  if (off && !off_) {
    off_since_ = entered ? ran_until : now;
    off_address_ = address;
  } else if (!off && off_) {
    EndOff(now);
  }
  off_ = off;

  const uint64_t stack = avr_->ramend - (avr_->data[kSpl] | avr_->data[kSph] << 8);
  report_.deepest_stack = std::max(report_.deepest_stack, stack);

  const bool marked = avr_->data[kGpior0] != 0;
  if (marked && marked_ && in_main) mark_ += ran_until - before;
  if (marked && !marked_) mark_ = 0;
  if (!marked && marked_) {
    ++report_.marks;
    report_.marked += mark_;
    report_.marked_most = std::max(report_.marked_most, mark_);
  }
  marked_ = marked;
}

void Probe::OnRunning(avr_irq_t* irq, uint32_t running, void* self) {
  Probe* probe = static_cast<Probe*>(self);
  if (running == 0) {
    probe->leaving_ = true;  // the cycles of RETI itself are not counted yet
    return;
  }
  const avr_t* avr = probe->avr_;
  for (int i = 0; i < avr->interrupts.vector_count; ++i)
    if (avr->interrupts.vector[i]->irq + AVR_INT_IRQ_RUNNING == irq)
      probe->entered_ = avr->interrupts.vector[i]->vector;
}

void Probe::EndOff(uint64_t cycle) {
  if (cycle - off_since_ <= report_.interrupts_off) return;
  report_.interrupts_off = cycle - off_since_;
  report_.interrupts_off_address = off_address_;
}

void Probe::Enter(int vector, uint64_t cycle) {
  if (!running_.empty()) running_.back().spent += cycle - running_.back().resumed;
  running_.push_back({vector, cycle, 0});
  if (vector != tick_vector_) return;
  burst_has_tick_ = true;
  if (last_tick_ != 0) {
    report_.tick_least = std::min(report_.tick_least, cycle - last_tick_);
    report_.tick_most = std::max(report_.tick_most, cycle - last_tick_);
  }
  last_tick_ = cycle;
}

void Probe::Leave(uint64_t cycle) {
  leaving_ = false;
  if (running_.empty()) return;  // entered before the probe existed
  const Running done = running_.back();
  running_.pop_back();
  const uint64_t cycles = done.spent + cycle - done.resumed;
  VectorCost& cost = report_.vector[done.vector];
  ++cost.entries;
  cost.cycles += cycles;
  cost.least = std::min(cost.least, cycles);
  cost.most = std::max(cost.most, cycles);
  if (!running_.empty()) running_.back().resumed = cycle;
}

}  // namespace thumper
