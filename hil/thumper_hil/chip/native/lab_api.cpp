// C interface of programmer, edge sources and probe, for instrumented_chip.py. It lets no exception through.
#include <algorithm>

#include "chip.hpp"
#include "edge_source.hpp"
#include "preemption.hpp"
#include "probe.hpp"
#include "programmer.hpp"

using thumper::Chip;
using thumper::EdgeSource;
using thumper::Probe;
using thumper::ProbeReport;
using thumper::Programmer;

extern "C" {

int thumper_write_flash(Chip* chip, uint32_t address, const uint8_t* data, size_t count) {
  return Programmer(chip->avr()).WriteFlash(address, data, count);
}
int thumper_read_flash(Chip* chip, uint32_t address, uint8_t* data, size_t count) {
  return Programmer(chip->avr()).ReadFlash(address, data, count);
}
int thumper_write_eeprom(Chip* chip, uint32_t address, const uint8_t* data, size_t count) {
  return Programmer(chip->avr()).WriteEeprom(address, data, count);
}
int thumper_read_eeprom(Chip* chip, uint32_t address, uint8_t* data, size_t count) {
  return Programmer(chip->avr()).ReadEeprom(address, data, count);
}
void thumper_start_at(Chip* chip, uint32_t address) { Programmer(chip->avr()).StartAt(address); }

void thumper_poke(Chip* chip, uint16_t address, uint8_t byte) { chip->avr()->data[address] = byte; }

EdgeSource* thumper_edges_open(Chip* chip, char port, int a_bit, int b_bit) {
  return new EdgeSource(chip->avr(), port, a_bit, b_bit);
}
void thumper_edges_start(EdgeSource* edges, uint64_t delay, uint64_t interval, uint64_t count) {
  edges->Start(delay, interval, count);
}
void thumper_edges_close(EdgeSource* edges) { delete edges; }

Probe* thumper_probe_open(Chip* chip, int tick_vector) { return new Probe(chip->avr(), tick_vector); }
int thumper_probe_run(Probe* probe, uint64_t until_cycle) { return probe->Run(until_cycle); }
void thumper_probe_report(const Probe* probe, ProbeReport* report) { *report = probe->report(); }
size_t thumper_probe_bursts(const Probe* probe, uint64_t* cycles, size_t capacity) {
  const size_t count = std::min(capacity, probe->tick_bursts().size());
  std::copy_n(probe->tick_bursts().begin(), count, cycles);
  return count;
}
void thumper_probe_close(Probe* probe) { delete probe; }

/// See PreemptionSweep::Run.
int thumper_sweep(Chip* chip, const thumper::WatchedMemory* watched, uint64_t until_cycle, int vector,
                  char port, int bit, const uint8_t* frame, size_t frame_size, uint64_t tail_cycles,
                  int stride, int per_address, const uint8_t* skip, thumper::Branch* branches,
                  size_t capacity) {
  return thumper::PreemptionSweep(*chip, *watched)
      .Run(until_cycle, vector, port, bit, frame, frame_size, tail_cycles, stride, per_address, skip,
           branches, capacity);
}

}  // extern "C"
