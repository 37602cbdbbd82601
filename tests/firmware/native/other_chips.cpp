// Instantiates the whole core. `make lint` compiles it for Cortex-M0+ (RP2040) and RV32, without a warning.

#include "core/beep.hpp"
#include "core/gyro_heading.hpp"
#include "core/host_interface.hpp"
#include "core/quadrature.hpp"

struct Line {
  void Put(uint8_t byte);
};

struct Memory {
  uint8_t Read(uint8_t address);
  bool Ready();
  void Write(uint8_t address, uint8_t byte);
};

void UseAll(fw::HostInterface& host, fw::Side& side, Memory& memory, Line& line) {
  host.Start(memory, fw::Fault::kNone);
  host.Receive(0, line);
  host.StepStore(memory, line);
  host.AdvanceTime(1);
  host.UpdateBattery(fw::BatteryFromSum_mV(1));
  host.LoseAnalogReadings();
  host.UpdateInputs(0);
  host.UpdateAcceleration({1, 2, 3});
  host.CountDropped(1);
  host.UpdateCurrents(fw::CurrentFromSum_mA(1, 2, 3), 0);
  fw::WheelConfig config;
  host.parameters().Derive(host.battery_mV(), &config);
  side.Step(host.command().mode, config, host.command().left, 0, false, &host.samples()->left);
  host.Watch();
  fw::GyroHeading gyro;
  gyro.Measure(1, host.stationary());
  gyro.Advance(1);
  host.SendTelemetry(line, gyro.heading(), fw::GyroscopeState::kReady);
  fw::QuadratureDecoder<3>().Step(0);
  fw::BeepPattern().Step(1, host.quiet());
}
