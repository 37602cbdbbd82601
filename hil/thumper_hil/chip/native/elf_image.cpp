#include "elf_image.hpp"

#include <elf.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>

namespace thumper {
namespace {

constexpr uint32_t kDataSpace = 0x800000;  // avr-ld gives SRAM, EEPROM and fuses addresses from here on

template <typename Header>
Header At(const std::vector<char>& file, uint64_t offset) {
  if (offset + sizeof(Header) > file.size())
    throw std::runtime_error("not a program for an AVR: it is cut off");
  Header header;
  std::memcpy(&header, file.data() + offset, sizeof header);
  return header;
}

}  // namespace

ElfImage ReadElf(const std::string& path, uint32_t flash_size) {
  std::ifstream stream(path, std::ios::binary);
  const std::vector<char> file{std::istreambuf_iterator<char>(stream), {}};
  const bool is_elf = file.size() >= sizeof(Elf32_Ehdr) && std::memcmp(file.data(), ELFMAG, SELFMAG) == 0;
  if (!is_elf || file[EI_CLASS] != ELFCLASS32 || At<Elf32_Ehdr>(file, 0).e_machine != EM_AVR)
    throw std::runtime_error("not a program for an AVR");
  const Elf32_Ehdr elf = At<Elf32_Ehdr>(file, 0);
  ElfImage image{{}, 0};
  for (uint32_t i = 0; i < elf.e_phnum; ++i) {
    const auto segment = At<Elf32_Phdr>(file, elf.e_phoff + uint64_t{i} * sizeof(Elf32_Phdr));
    if (segment.p_type != PT_LOAD || segment.p_filesz == 0 || segment.p_paddr >= kDataSpace) continue;
    const uint64_t end = uint64_t{segment.p_paddr} + segment.p_filesz;
    if (end > flash_size) throw std::runtime_error("larger than the flash of an ATmega328P");
    if (uint64_t{segment.p_offset} + segment.p_filesz > file.size())
      throw std::runtime_error("not a program for an AVR: it is cut off");
    const auto begin = file.begin() + segment.p_offset;
    image.segments.push_back({segment.p_paddr, {begin, begin + segment.p_filesz}});
    if ((segment.p_flags & PF_X) != 0) image.code_end = std::max(image.code_end, static_cast<uint32_t>(end));
  }
  if (image.code_end == 0) throw std::runtime_error("not a program for an AVR: it has no code");
  return image;
}

}  // namespace thumper
