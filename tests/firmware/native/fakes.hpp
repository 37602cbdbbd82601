// Fakes for the core's environment in the host build: byte sinks and an EEPROM.

#pragma once

#include <cstdint>
#include <cstring>
#include <vector>

#include "core/host_interface.hpp"

struct Bytes {
  std::vector<uint8_t> data;
  void Put(uint8_t byte) { data.push_back(byte); }
};

struct Words {
  std::vector<int32_t> data;
  void Put(int32_t word) { data.push_back(word); }
};

/// An EEPROM whose power fails after a number of writes. The byte being written is then half done.
struct Eeprom {
  uint8_t cells[256];
  int writes_left = 1000000;
  int busy = 0;  // polls until the write is done

  Eeprom() { std::memset(cells, 0xFF, sizeof(cells)); }
  uint8_t Read(uint8_t address) const { return cells[address]; }
  bool Ready() {
    if (busy > 0) --busy;
    return busy == 0;
  }
  void Write(uint8_t address, uint8_t byte) {
    if (writes_left <= 0) return;
    --writes_left;
    cells[address] = writes_left == 0 ? cells[address] & 0x5A : byte;
    busy = 3;
  }
};

struct Interface {
  fw::HostInterface host;
  Eeprom* eeprom;
  int handled = 0;  // valid frames
  Interface(fw::ResetCause cause, fw::Fault latched, Eeprom* memory, fw::Board board = fw::Board::kTrex)
      : host(board, cause), eeprom(memory) {
    host.Start(*eeprom, latched);
  }
};
