#pragma once
#include <vector>

#include "chip.hpp"

namespace thumper {

/// Which memory a branch records: one range when the control tick starts, one when it ends.
struct WatchedMemory {
  uint16_t at_entry, entry_size, at_exit, exit_size;
};

/// What happened after an interrupt was forced right after one instruction.
struct Branch {
  static constexpr int kTicks = 4, kMemory = 48, kBytes = 320;
  uint64_t cycle;                  // of the instruction
  uint32_t address;                // of the instruction [bytes]
  uint32_t crashed;                // 1: the firmware crashed or never slept again
  uint32_t ticks;                  // control ticks since the sweep began; only the first kTicks are recorded
  uint8_t entry[kTicks][kMemory];  // memory when they started
  uint8_t exit[kTicks][kMemory];   // and when they ended
  uint64_t shortest_rest[2];       // [cycles] left, right: from a change of direction to a driven pin
  uint64_t longest_pulse[2];       // [cycles] left, right: PWM pin high while the timer does not drive it
  uint32_t byte_count;             // bytes that have arrived from the chip
  uint8_t bytes[kBytes];
};

/// Forces an interrupt at every instruction of the main loop, each in a forked copy of the process, and
/// records what follows. The chip itself runs on as if nothing had happened.
class PreemptionSweep {
 public:
  PreemptionSweep(Chip& chip, const WatchedMemory& watched);
  ~PreemptionSweep();
  PreemptionSweep(const PreemptionSweep&) = delete;
  PreemptionSweep& operator=(const PreemptionSweep&) = delete;

  /// Sweep until a cycle, at every `stride`-th instruction; each branch runs on for `tail_cycles`. `vector`:
  /// the interrupt; for a pin-change vector the pin `port`, `bit` toggles, for the receive vector `frame`
  /// arrives. Serial port, converter and two-wire interface end early what they are doing, so only
  /// instructions count while they do. per_address > 0: only that often at each address, and each branch
  /// records only what follows and the frame that is arriving; its first tick is then the last one before it.
  /// Then `skip`, one byte per address of the program, names addresses to leave out.
  /// Return the number of branches, at most `capacity`, or -1
  /// if the system is out of processes.
  int Run(uint64_t until_cycle, int vector, char port, int bit, const uint8_t* frame, std::size_t frame_size,
          uint64_t tail_cycles, int stride, int per_address, const uint8_t* skip, Branch* branches,
          std::size_t capacity);

 private:
  static void OnRunning(avr_irq_t* irq, uint32_t running, void* self);
  bool Step();
  void Forget();
  bool CanForce(int vector) const;
  std::vector<void*> OwnersOf(int vector) const;
  void EndEarly(int vector);
  void Force(int vector, char port, int bit, const uint8_t* frame, std::size_t frame_size);
  void Track();

  Chip& chip_;
  avr_t* avr_;
  WatchedMemory watched_;
  Branch now_{};
  int depth_ = 0;  // interrupts that run
  bool forward_[2], driven_[2];
  uint64_t turned_[2] = {0, 0}, high_since_[2] = {0, 0};
};

}  // namespace thumper
