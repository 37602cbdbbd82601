// libFuzzer target: arbitrary bytes through parser, supervisor, monitors and parameters.
//
// The input is a script. 0xF0 to 0xF5 trigger another event (time, battery, currents, ticks, save and load
// work, a restart), with the following bytes as its arguments. 0xFE sends a frame with valid CRC and COBS, so
// that the fuzzer gets past them. Every other byte goes directly to the parser.

#include <cstdlib>
#include <cstring>
#include <memory>

#include "core/host_interface.hpp"

namespace {

struct Sink {
  int bytes = 0;
  void Put(uint8_t) { ++bytes; }
};

struct Memory {
  uint8_t cells[256];
  uint8_t Read(uint8_t address) const { return cells[address]; }
  bool Ready() const { return true; }
  void Write(uint8_t address, uint8_t byte) { cells[address] = byte; }
};

struct Script {
  const uint8_t* data;
  size_t left;
  uint8_t Take() { return left == 0 ? 0 : (--left, *data++); }
  int16_t Take16() {
    const uint8_t low = Take();
    return static_cast<int16_t>(low | Take() << 8);
  }
};

void Check(bool held) {
  if (!held) std::abort();
}

/// Conditions that must hold after any input.
void CheckSafe(const fw::HostInterface& host) {
  const auto& command = host.command();
  const bool armed = host.supervisor().armed();
  Check(command.mode == host.supervisor().state());
  Check(armed || (command.left == 0 && command.right == 0));
  const int limit = command.mode == fw::State::kManual ? fw::kMaxPwm : fw::kMaxSpeed_mrad_s;
  Check(std::abs(command.left) <= limit && std::abs(command.right) <= limit);
  Check((host.supervisor().state() == fw::State::kFault) == (host.supervisor().fault() != fw::Fault::kNone));
  for (uint8_t i = 0; i < fw::kParameterCount; ++i) {
    const auto& range = fw::kParameterRanges[i];
    Check(host.parameters().Get(i) >= range.minimum && host.parameters().Get(i) <= range.maximum);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Script script = {data, size};
  Memory memory;
  std::memset(memory.cells, 0xFF, sizeof(memory.cells));
  Sink sink;
  auto host = std::make_unique<fw::HostInterface>(fw::Board::kTrex, fw::ResetCause::kPowerOn);
  host->Start(memory, fw::Fault::kNone);
  host->UpdateBattery(7400);
  fw::Side side;
  fw::WheelConfig config;
  while (script.left != 0) {
    const uint8_t byte = script.Take();
    switch (byte) {
      case 0xF0:
        host->AdvanceTime(script.Take());
        break;
      case 0xF1:
        host->UpdateBattery(static_cast<uint16_t>(script.Take16()));
        break;
      case 0xF2: {
        const int16_t left = script.Take16();
        host->UpdateCurrents(left, script.Take16());
        break;
      }
      case 0xF3: {
        auto* samples = host->samples();
        host->parameters().Derive(host->battery_mV(), &config);
        side.Step(host->command().mode, config, host->command().left, static_cast<uint16_t>(script.Take16()),
                  false, &samples->left);
        samples->lost_edges = static_cast<uint16_t>(samples->lost_edges + script.Take());
        host->Watch();
        host->SendTelemetry(sink, 0, fw::GyroscopeState::kOff);
        break;
      }
      case 0xF4:
        host->StepStore(memory, sink);
        break;
      case 0xF5:
        for (uint8_t i = script.Take() % 8; i != 0; --i) memory.cells[script.Take()] = script.Take();
        host = std::make_unique<fw::HostInterface>(fw::Board::kTrex,
                                                   static_cast<fw::ResetCause>(script.Take() % 5));
        host->Start(memory, static_cast<fw::Fault>(script.Take() % fw::kFaultCount));
        break;
      case 0xFE: {
        struct Line {
          fw::HostInterface* host;
          Sink* sink;
          void Put(uint8_t wire) { host->Receive(wire, *sink); }
        } line = {host.get(), &sink};
        uint8_t body[12];
        const uint8_t length = 2 + script.Take() % 8;
        for (uint8_t i = 0; i < length; ++i) body[i] = script.Take();
        line.Put(0);
        fw::SendBody(line, body, length + 2);
        break;
      }
      default:
        host->Receive(byte, sink);
    }
    CheckSafe(*host);
  }
  for (int i = 0; i < 2; ++i) host->AdvanceTime(150);
  Check(!host->supervisor().armed());  // 300 ms of silence end every drive
  return 0;
}
