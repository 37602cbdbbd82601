// Calls an encoder's interrupt in the image that is flashed, from every state with every new level of its
// pins. One call has no memory but the state that it leaves, which is compared in full: so every sequence
// follows.
//
// flashed_interrupt ELF VECTOR DECODER PINS MASK    DECODER: address of its variable; PINS: of the port's
// input
//
// Prints how many calls it checked. Prints the first difference and exits with 1.

#include <simavr/sim_avr.h>
#include <simavr/sim_core.h>
#include <simavr/sim_elf.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

constexpr uint32_t kReturn = 0x7FFE;  // no code is there
constexpr int kStackTop = 0x8FF, kLongest = 60;

/// The decoder's variables, in the order of core/quadrature.hpp.
struct State {
  uint8_t ab, low, high, lost_low, lost_high;
};

void Silent(avr_t*, int, const char*, va_list) {}

/// Call the interrupt. Return false if it does not return.
bool Call(avr_t* avr, uint32_t vector) {
  avr->data[kStackTop] = kReturn / 2 & 0xFF;
  avr->data[kStackTop - 1] = kReturn / 2 >> 8;
  avr->data[R_SPL] = (kStackTop - 2) & 0xFF;
  avr->data[R_SPH] = (kStackTop - 2) >> 8;
  avr->pc = 4 * vector;
  for (int i = 0; i < kLongest && avr->pc != kReturn; ++i) avr->pc = avr_run_one(avr);
  return avr->pc == kReturn;
}

/// Return the state after the pins have changed.
State Expected(State state, int old_level, int new_level, uint8_t pins) {
  constexpr int kPosition[4] = {0, 1, 3, 2};  // along a forward turn, of B << 1 | A
  const int moved = (kPosition[new_level] - kPosition[old_level] + 4) % 4;
  const uint16_t count = static_cast<uint16_t>((state.high << 8 | state.low) + (moved == 1   ? 1
                                                                                : moved == 3 ? -1
                                                                                             : 0));
  const uint16_t lost = static_cast<uint16_t>((state.lost_high << 8 | state.lost_low) + (moved == 2));
  return {pins, static_cast<uint8_t>(count), static_cast<uint8_t>(count >> 8), static_cast<uint8_t>(lost),
          static_cast<uint8_t>(lost >> 8)};
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 6) return 2;
  const uint32_t vector = std::strtoul(argv[2], nullptr, 0), decoder = std::strtoul(argv[3], nullptr, 0);
  const uint32_t port = std::strtoul(argv[4], nullptr, 0), mask = std::strtoul(argv[5], nullptr, 0);
  const int shift = __builtin_ctz(mask);
  avr_global_logger_set(Silent);
  elf_firmware_t firmware{};
  if (elf_read_firmware(argv[1], &firmware) != 0) return 3;
  avr_t* avr = avr_make_mcu_by_name("atmega328p");
  avr_init(avr);
  avr_load_firmware(avr, &firmware);
  uint64_t calls = 0;
  for (uint32_t count = 0; count < 0x10000; ++count) {
    for (int levels = 0; levels < 16; ++levels, ++calls) {
      const int old_level = levels & 3, new_level = levels >> 2;
      const State before = {static_cast<uint8_t>(old_level << shift), static_cast<uint8_t>(count),
                            static_cast<uint8_t>(count >> 8), static_cast<uint8_t>(~count),
                            static_cast<uint8_t>(~count >> 8)};
      const uint8_t pins = static_cast<uint8_t>(new_level << shift);
      std::memcpy(avr->data + decoder, &before, sizeof(before));
      avr->data[port] = static_cast<uint8_t>(pins | ((count * 7 + levels) & ~mask));  // the port's other pins
      uint8_t registers[32];
      for (int i = 0; i < 32; ++i)
        registers[i] = avr->data[i] = static_cast<uint8_t>(count * 31 + levels + i);
      for (int i = 0; i < 8; ++i) avr->sreg[i] = (count >> i & 1) != 0 && i != S_I;  // I is cleared on entry
      const bool returned = Call(avr, vector);
      const State after = Expected(before, old_level, new_level, pins);
      bool flags = avr->sreg[S_I] != 0;
      for (int i = 0; i < S_I; ++i) flags = flags && avr->sreg[i] == (count >> i & 1);
      if (!returned || !flags || std::memcmp(avr->data, registers, sizeof(registers)) != 0 ||
          std::memcmp(avr->data + decoder, &after, sizeof(after)) != 0) {
        std::printf("count %u, level %d to %d\n", count, old_level, new_level);
        return 1;
      }
    }
  }
  std::printf("%llu\n", static_cast<unsigned long long>(calls));
  return 0;
}
