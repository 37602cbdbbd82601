#pragma once
#include <stdint.h>

#include "core/crc.hpp"
#include "core/parameters.hpp"

namespace fw {

/// Stores the parameters in EEPROM: two slots, written alternately, each
///
///   sequence u8 | values, int16 low byte first | CRC-16 over both, low byte first
///
/// A save overwrites the slot without the newest set, so a power failure at any byte leaves the other slot
/// intact. The CRC starts from the schema hash, so a set of another firmware fails the check. Sequence 0xFF
/// marks an empty slot (erased EEPROM). The sequence byte is written last.
///
/// Memory: `uint8_t Read(uint8_t address)`, `bool Ready()`, `void Write(uint8_t address, uint8_t byte)`.
/// Write() only starts a write of 3.4 ms.
class ParameterStore {
 public:
  enum class Outcome : uint8_t { kEmpty, kLoaded, kUnreadable };

  /// Read the newest valid set into `parameters`. Without one they stay unchanged. Call it first.
  template <typename Memory>
  Outcome Load(Memory& memory, Parameters* parameters) {
    uint8_t sequence[2];
    bool valid[2], used[2];
    for (uint8_t slot = 0; slot < 2; ++slot) {
      sequence[slot] = memory.Read(Address(slot));
      used[slot] = sequence[slot] != kEmpty;
      valid[slot] = used[slot] && Check(memory, slot);
    }
    if (!valid[0] && !valid[1]) {
      next_slot_ = 0;
      next_sequence_ = 0;
      return used[0] || used[1] ? Outcome::kUnreadable : Outcome::kEmpty;
    }
    const bool second_newer = !valid[0] || (valid[1] && static_cast<int8_t>(sequence[1] - sequence[0]) > 0);
    const uint8_t slot = second_newer ? 1 : 0;
    next_slot_ = slot ^ 1;
    next_sequence_ = After(sequence[slot]);
    parameters->Restore();
    uint8_t address = Address(slot) + 1;
    for (uint8_t i = 0; i < kParameterCount; ++i, address += 2) {
      const uint16_t value = static_cast<uint16_t>(memory.Read(address + 1) << 8 | memory.Read(address));
      parameters->Set(i, static_cast<int16_t>(value));  // keeps the default if the value is out of range
    }
    return Outcome::kLoaded;
  }

  /// Start saving a copy of `parameters`; Step() writes it. Call only if no save is in progress.
  void Begin(const Parameters& parameters) {
    image_[0] = next_sequence_;
    for (uint8_t i = 0; i < kParameterCount; ++i) {
      const uint16_t value = static_cast<uint16_t>(parameters.Get(i));
      image_[1 + 2 * i] = static_cast<uint8_t>(value);
      image_[2 + 2 * i] = static_cast<uint8_t>(value >> 8);
    }
    uint16_t crc = kStart;
    for (uint8_t i = 0; i < kSlotSize - 2; ++i) crc = Crc16(crc, image_[i]);
    image_[kSlotSize - 2] = static_cast<uint8_t>(crc);
    image_[kSlotSize - 1] = static_cast<uint8_t>(crc >> 8);
    remaining_ = kSlotSize;
  }

  bool saving() const { return remaining_ != 0; }

  /// Continue the save by at most one byte, without waiting. Return true when it has just finished.
  template <typename Memory>
  bool Step(Memory& memory) {
    if (remaining_ == 0 || !memory.Ready()) return false;
    if (written_) {
      written_ = false;
      if (--remaining_ == 0) return true;
    }
    memory.Write(Address(next_slot_) + remaining_ - 1, image_[remaining_ - 1]);
    written_ = true;
    return false;
  }

  /// Verify a finished save by reading it back. On success, select the other slot for the next save.
  template <typename Memory>
  bool Verify(Memory& memory) {
    if (memory.Read(Address(next_slot_)) != next_sequence_ || !Check(memory, next_slot_)) return false;
    next_slot_ ^= 1;
    next_sequence_ = After(next_sequence_);
    return true;
  }

 private:
  static constexpr uint8_t kSlotSize = 1 + 2 * kParameterCount + 2;
  static constexpr uint8_t kEmpty = 0xFF;
  static constexpr uint16_t kStart = static_cast<uint16_t>(kSchemaHash);

  /// Does not start at address 0: a brown-out during a write corrupts that cell first.
  static constexpr uint8_t Address(uint8_t slot) { return slot == 0 ? 0x20 : 0x80; }
  static_assert(0x20 + kSlotSize <= 0x80 && 0x80 + kSlotSize <= 0x100, "the slots must not overlap");

  static constexpr uint8_t After(uint8_t sequence) { return sequence >= kEmpty - 1 ? 0 : sequence + 1; }

  template <typename Memory>
  static bool Check(Memory& memory, uint8_t slot) {
    uint16_t crc = kStart;
    for (uint8_t i = 0; i < kSlotSize; ++i) crc = Crc16(crc, memory.Read(Address(slot) + i));
    return crc == 0;
  }

  uint8_t image_[kSlotSize];
  uint8_t remaining_ = 0;
  bool written_ = false;
  uint8_t next_slot_, next_sequence_;  // set by Load()
};

}  // namespace fw
