#pragma once
#include <cstdint>
#include <string>
#include <vector>

namespace thumper {

/// A program as it lies in flash.
struct ElfImage {
  struct Segment {
    uint32_t address;
    std::vector<uint8_t> bytes;
  };
  std::vector<Segment> segments;
  uint32_t code_end;  // behind the last instruction; initial values of variables may follow
};

/// Return what the ELF file of an AVR program puts into flash. Throws std::runtime_error.
ElfImage ReadElf(const std::string& path, uint32_t flash_size);

}  // namespace thumper
