#include "plant.hpp"

#include <algorithm>
#include <cmath>

#include "input_pin.hpp"

namespace thumper {
Plant::Plant(avr_t* avr, const PlantParams& params, const Wiring& wiring, uint64_t seed)
    : avr_(avr),
      params_(params),
      wiring_(wiring),
      clock_Hz_(kCpuHz * (1.0 + params.board.clock_drift)),
      bridges_(avr, wiring, params.board.pwm_low_coasts != 0.0),
      drive_train_(params, seed),
      random_(~seed),
      encoder_{Wire(0, seed), Wire(1, seed)},
      left_current_channel_(wiring.current_channel[0]),
      planned_to_(avr->cycle),
      planned_from_(avr->cycle),
      before_(drive_train_) {
  for (int side = 0; side < 2; ++side) {
    const MotorWiring& motor = wiring.motor[side];
    for (const int bit : {motor.forward_bit, motor.reverse_bit, motor.brake_bit, BridgePins::kPwmBit})
      if (bit != Wiring::kNone)
        avr_irq_register_notify(encoder_[side].port->io.irq + IOPORT_IRQ_PIN0 + bit, OnMotorPin, this);
  }
  Rearm();
}

Plant::EncoderPins Plant::Wire(int side, uint64_t seed) {
  const EncoderWiring& pins = wiring_.encoder[side];
  return {this,
          FindPeripheral<avr_ioport_t>(avr_, "port", pins.port),
          pins.a_bit,
          pins.b_bit,
          Encoder(params_.encoder, random_),
          {},
          false,
          0.0,
          EncoderPins::kNoGlitch,
          Random(seed + 0x617C + static_cast<uint64_t>(side))};
}

void Plant::Rearm() {
  for (EncoderPins& pins : encoder_) {
    pins.port->external.pull_mask |= (1u << pins.a_bit) | (1u << pins.b_bit);
    pins.glitch_channel = EncoderPins::kNoGlitch;
    DriveBoth(pins);
    ScheduleEdge(pins);
    ScheduleGlitch(pins);
  }
  DriveSwitches();
  const uint64_t wait = planned_to_ > avr_->cycle ? planned_to_ - avr_->cycle : 1;
  avr_cycle_timer_register(avr_, wait, OnTick, this);
}

avr_cycle_count_t Plant::OnTick(avr_t*, avr_cycle_count_t when, void* self) {
  Plant* plant = static_cast<Plant*>(self);
  plant->accelerometer_.Step(plant->drive_train_.speed_m_s(), plant->YawRate(), plant->Seconds(kCyclesPerMs));
  plant->PlanTo(when + kCyclesPerMs);
  return plant->planned_to_;
}

void Plant::OnMotorPin(avr_irq_t* irq, uint32_t, void* self) {
  Plant* plant = static_cast<Plant*>(self);
  if (static_cast<int>(irq->irq) == BridgePins::kPwmBit && plant->bridges_.pwm_running())
    return;  // the duty has all the information
  const uint64_t now = plant->avr_->cycle;
  if (now >= plant->planned_to_) return;  // the tick is due and handles it
  // The inputs changed during the planned step. Repeat the step up to now, then plan the rest.
  const uint64_t end_cycle = plant->planned_to_;
  plant->drive_train_ = plant->before_;
  if (now > plant->planned_from_)
    plant->drive_train_.Step(plant->command_, plant->Seconds(now - plant->planned_from_));
  plant->planned_to_ = now;
  plant->PlanTo(end_cycle);
}

void Plant::PlanTo(uint64_t end_cycle) {
  bridges_.Sample();
  command_[0] = bridges_.left();
  command_[1] = bridges_.right();
  before_ = drive_train_;
  planned_from_ = planned_to_;
  planned_to_ = end_cycle;
  drive_train_.Step(command_, Seconds(planned_to_ - planned_from_));
  for (int side = 0; side < 2; ++side) {
    encoder_[side].encoder.Plan(before_.state().wheel_rad[side], drive_train_.state().wheel_rad[side],
                                planned_from_, planned_to_ - planned_from_);
    ScheduleEdge(encoder_[side]);
  }
}

void Plant::Place(double x_m, double y_m, double yaw_rad) {
  before_.Place(x_m, y_m, yaw_rad);
  drive_train_.Place(x_m, y_m, yaw_rad);
}

void Plant::Hold(double v_m_s, double w_rad_s) {
  before_.Hold(v_m_s, w_rad_s);
  drive_train_.Hold(v_m_s, w_rad_s);
  touches_ = true;
  DriveSwitches();
}

void Plant::Release() {
  before_.Release();
  drive_train_.Release();
  touches_ = false;
  DriveSwitches();
}

void Plant::SetClimb(double climb_rad) {
  before_.SetClimb(climb_rad);
  drive_train_.SetClimb(climb_rad);
}

void Plant::SetSwitch(int input, bool closed) {
  closed_[input] = closed;
  DriveSwitches();
}

void Plant::DriveSwitches() {
  for (int input = 0; input < 2; ++input) {
    const SwitchWiring& pin = wiring_.input[input];
    avr_ioport_t* port = FindPeripheral<avr_ioport_t>(avr_, "port", pin.port);
    port->external.pull_mask |= static_cast<uint8_t>(1u << pin.bit);
    DriveInput(port, pin.bit, !closed_[input] && !(input == 0 && touches_));
  }
}

void Plant::ScheduleEdge(EncoderPins& pins) {
  const uint64_t edge = pins.encoder.NextEdge();
  if (edge == 0) {
    avr_cycle_timer_cancel(avr_, OnEdge, &pins);
    return;
  }
  avr_cycle_timer_register(avr_, edge > avr_->cycle ? edge - avr_->cycle : 1, OnEdge, &pins);
}

avr_cycle_count_t Plant::OnEdge(avr_t* avr, avr_cycle_count_t, void* self) {
  EncoderPins& pins = *static_cast<EncoderPins*>(self);
  pins.encoder.PassEdge();
  DriveBoth(pins);
  const uint64_t next = pins.encoder.NextEdge();
  return next == 0 ? 0 : std::max<uint64_t>(next, avr->cycle + 1);
}

void Plant::DriveBoth(EncoderPins& pins) {
  const bool level[2] = {pins.encoder.a(), pins.encoder.b()};
  DriveWire(pins, 0, pins.a_bit, level[pins.swapped ? 1 : 0]);
  DriveWire(pins, 1, pins.b_bit, level[pins.swapped ? 0 : 1]);
}

void Plant::DriveWire(EncoderPins& pins, int channel, int bit, bool level) {
  const WireFault fault = pins.fault[channel];
  if (fault == WireFault::kStuck) return;
  const bool driven = fault == WireFault::kNone ? level : fault == WireFault::kCut;
  DriveInput(pins.port, bit, driven != (channel == pins.glitch_channel));
}

void Plant::ScheduleGlitch(EncoderPins& pins) {
  avr_t* avr = pins.plant->avr_;
  avr_cycle_timer_cancel(avr, OnGlitch, &pins);
  if (pins.glitches_Hz == 0.0) return;
  const double wait_s = -std::log(1.0 - pins.glitch_random.Uniform()) / pins.glitches_Hz;  // Poisson
  avr_cycle_timer_register(avr, 1 + static_cast<uint64_t>(wait_s * kCpuHz), OnGlitch, &pins);
}

/// Start or end a pulse of 1 to 10 us, as motor brushes couple into a neighbouring wire.
avr_cycle_count_t Plant::OnGlitch(avr_t* avr, avr_cycle_count_t, void* self) {
  EncoderPins& pins = *static_cast<EncoderPins*>(self);
  const bool begins = pins.glitch_channel == EncoderPins::kNoGlitch;
  pins.glitch_channel = !begins ? EncoderPins::kNoGlitch : pins.glitch_random.Uniform() < 0.5 ? 0 : 1;
  DriveBoth(pins);
  if (begins) return avr->cycle + 16 + static_cast<uint64_t>(144.0 * pins.glitch_random.Uniform());
  ScheduleGlitch(pins);
  return 0;
}

void Plant::SetSideFaults(int side, const SideFaults& faults) {
  before_.SetFaults(side, faults);
  drive_train_.SetFaults(side, faults);
}

void Plant::SetWireFault(int side, int channel, WireFault fault) {
  encoder_[side].fault[channel] = fault;
  DriveBoth(encoder_[side]);
}

void Plant::SetChannelsSwapped(int side, bool swapped) {
  encoder_[side].swapped = swapped;
  DriveBoth(encoder_[side]);
}

void Plant::SetGlitches(int side, double per_s) {
  encoder_[side].glitches_Hz = per_s;
  encoder_[side].glitch_channel = EncoderPins::kNoGlitch;
  DriveBoth(encoder_[side]);
  ScheduleGlitch(encoder_[side]);
}

void Plant::SetBattery(double charge, double resistance_Ohm) {
  for (DriveTrain* train : {&before_, &drive_train_}) {
    if (charge >= 0.0) train->battery().SetCharge(charge);
    if (resistance_Ohm >= 0.0) train->battery().SetResistance(resistance_Ohm);
  }
}

double Plant::AnalogIn_V(int channel) const {
  constexpr double kVoltPerCount = 5.0 / 1024.0;
  if (channel == wiring_.battery_channel) {
    return drive_train_.battery().voltage_V() / params_.board.battery_V_per_count * kVoltPerCount;
  }
  for (int side = 0; side < 2; ++side) {
    if (channel != left_current_channel_ + side) continue;
    const double current_A = drive_train_.state().current_A[side];
    return (params_.board.current_zero_counts + current_A / params_.board.current_A_per_count) *
           kVoltPerCount;
  }
  const int axis = channel - wiring_.accelerometer_channel;
  if (wiring_.accelerometer_channel != Wiring::kNone && axis >= 0 && axis < 3) {
    return accelerometer_.Output_V(axis);
  }
  return 0.0;
}

double Plant::YawRate() const {
  if (planned_to_ == planned_from_) return 0.0;
  return std::remainder(drive_train_.state().yaw_rad - before_.state().yaw_rad, 2.0 * M_PI) /
         Seconds(planned_to_ - planned_from_);
}

RobotState Plant::State() const {
  const RobotState& from = before_.state();
  RobotState state = drive_train_.state();
  if (avr_->cycle >= planned_to_) return state;
  const double part =
      static_cast<double>(avr_->cycle - planned_from_) / static_cast<double>(planned_to_ - planned_from_);
  const auto between = [part](double a, double b) { return a + part * (b - a); };
  state.x_m = between(from.x_m, state.x_m);
  state.y_m = between(from.y_m, state.y_m);
  state.yaw_rad = from.yaw_rad + part * std::remainder(state.yaw_rad - from.yaw_rad, 2.0 * M_PI);
  for (int side = 0; side < 2; ++side) {
    state.wheel_rad[side] = between(from.wheel_rad[side], state.wheel_rad[side]);
    state.wheel_rad_s[side] = between(from.wheel_rad_s[side], state.wheel_rad_s[side]);
  }
  return state;
}

}  // namespace thumper
