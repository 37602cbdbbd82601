#pragma once
#include <vector>

#include "avr.hpp"

namespace thumper {

/// What one interrupt vector took, its response of four cycles included and what interrupted it left out.
struct VectorCost {
  uint64_t entries, cycles, least, most;
};

/// What a probe has seen; all in clock cycles, addresses in bytes.
struct ProbeReport {
  static constexpr int kVectors = 26;
  VectorCost vector[kVectors];
  uint64_t interrupts_off;          // the longest stretch
  uint64_t interrupts_off_address;  // the instruction after which it began
  uint64_t deepest_stack;           // [bytes]
  uint64_t tick_least, tick_most;   // between two entries of the tick's vector
  uint64_t awake;                   // not asleep
  uint64_t main_awake;              // and in no interrupt
  uint64_t marks;                   // how often GPIOR0 went from 0 to not 0,
  uint64_t marked, marked_most;     // the cycles until it was 0 again, interrupts left out, and the most
};

/// Steps a chip instruction by instruction and keeps the books. Slow (some million cycles a second).
class Probe {
 public:
  Probe(avr_t* avr, int tick_vector);
  ~Probe();
  Probe(const Probe&) = delete;
  Probe& operator=(const Probe&) = delete;

  /// Run until this cycle; false when the firmware died.
  bool Run(uint64_t until_cycle);

  const ProbeReport& report() const { return report_; }
  /// Cycles of the main loop from waking up to falling asleep, for each time that the tick came in between.
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
  void Look(uint64_t before, uint32_t address);

  avr_t* avr_;
  int tick_vector_;
  ProbeReport report_{};
  std::vector<Running> running_;
  std::vector<uint64_t> tick_bursts_;
  int entered_ = 0;  // the vector entered behind the present instruction
  bool leaving_ = false, off_ = false, burst_has_tick_ = false, marked_ = false;
  uint64_t off_since_ = 0, off_address_ = 0, last_tick_ = 0, burst_ = 0, mark_ = 0;
};

}  // namespace thumper
