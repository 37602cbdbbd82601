#pragma once
#include <vector>

#include "avr.hpp"

namespace thumper {

/// Cost of one interrupt vector, including its response of four cycles, without nested interrupts.
struct VectorCost {
  uint64_t entries, cycles, least, most;
};

/// Measurements of a probe, all in clock cycles; addresses in bytes.
struct ProbeReport {
  static constexpr int kVectors = 26;
  VectorCost vector[kVectors];
  uint64_t interrupts_off;          // longest time with interrupts off
  uint64_t interrupts_off_address;  // address of the instruction that started it
  uint64_t deepest_stack;           // [bytes]
  uint64_t tick_least, tick_most;   // between two entries of the tick vector
  uint64_t awake;                   // not asleep
  uint64_t main_awake;              // awake and in no interrupt
  uint64_t marks;                   // how often GPIOR0 changed from zero to non-zero
  uint64_t marked, marked_most;     // cycles until it was zero again, without interrupts: total and maximum
};

/// Steps a chip instruction by instruction and accounts for each cycle. Slow (some million cycles per
/// second).
class Probe {
 public:
  Probe(avr_t* avr, int tick_vector);
  ~Probe();
  Probe(const Probe&) = delete;
  Probe& operator=(const Probe&) = delete;

  /// Run until this cycle. Return false if the firmware crashed or stopped.
  bool Run(uint64_t until_cycle);

  const ProbeReport& report() const { return report_; }
  /// Cycles of the main loop from wake-up to sleep, for each time that contained a tick.
  const std::vector<uint64_t>& tick_bursts() const { return tick_bursts_; }

 private:
  struct Running {
    int vector;
    uint64_t resumed, spent;
  };

  static void OnRunning(avr_irq_t* irq, uint32_t running, void* self);
  void Enter(int vector, uint64_t cycle);
  void Leave(uint64_t cycle);
  void EndOff(uint64_t cycle);
  void Account(uint64_t before, uint32_t address);

  avr_t* avr_;
  int tick_vector_;
  ProbeReport report_{};
  std::vector<Running> running_;
  std::vector<uint64_t> tick_bursts_;
  int entered_ = 0;  // the vector entered after the current instruction
  bool leaving_ = false, off_ = false, burst_has_tick_ = false, marked_ = false;
  uint64_t off_since_ = 0, off_address_ = 0, last_tick_ = 0, burst_ = 0, mark_ = 0;
};

}  // namespace thumper
