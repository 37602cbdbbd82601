// The firmware's core in the host build, behind C functions of plain ints, so that Python needs no
// declarations. Objects have numbers; `*_new` returns the number.

#include <cstring>
#include <vector>

#include "core/acceleration.hpp"
#include "core/beep.hpp"
#include "core/gyro_heading.hpp"
#include "core/host_interface.hpp"
#include "core/quadrature.hpp"
#include "fakes.hpp"
#include "vectors.hpp"

namespace {

// One list for all types: a container for each would take most of the compile time.
std::vector<void*> objects;

template <typename T>
T& At(int number) {
  return *static_cast<T*>(objects[number]);
}

template <typename T, typename... Args>
int New(Args... args) {
  objects.push_back(new T(args...));
  return static_cast<int>(objects.size()) - 1;
}

using Decoder = fw::FrameDecoder<60>;
using Quadrature = fw::QuadratureDecoder<0x03>;

/// out: kp, ki, friction, kv, lead, decay, mean, ramp steps.
void Derive(const fw::Parameters& parameters, uint16_t battery_mV, int32_t* out) {
  static fw::WheelConfig config;  // as on the chip, the last constants are still in it
  parameters.Derive(battery_mV, &config);
  const auto& f = config.feed_forward;
  const int32_t all[] = {config.pi.kp, config.pi.ki,         f.friction,           f.kv, f.lead, f.decay,
                         f.mean,       config.ramp.speed_up, config.ramp.slow_down};
  std::memcpy(out, all, sizeof(all));
}

}  // namespace

extern "C" {

int pi_new() { return New<fw::PiController>(); }
int pi_step(int pi, int kp, int ki, int error, int feed_forward, int idle) {
  const fw::PiGains gains = {static_cast<int16_t>(kp), static_cast<int16_t>(ki)};
  return At<fw::PiController>(pi).Step(gains, static_cast<int16_t>(error), feed_forward, idle != 0);
}
/// Run from rest, without feed-forward. Return the final integral.
int pi_run(int kp, int ki, const int16_t* errors, int ticks, int16_t* pwms) {
  const fw::PiGains gains = {static_cast<int16_t>(kp), static_cast<int16_t>(ki)};
  fw::PiController pi;
  for (int tick = 0; tick < ticks; ++tick) pwms[tick] = pi.Step(gains, errors[tick], 0, false);
  return pi.integral();
}
void pi_reset(int pi) { At<fw::PiController>(pi).Reset(); }
int pi_integral(int pi) { return At<fw::PiController>(pi).integral(); }

/// values: wire values of the gains, all parameters before those of the robot. out: speed, set-point, PWM,
/// integral, prediction constants.
int wheel_new() { return New<fw::WheelController>(); }
int wheel_step(int wheel, const int32_t* values, int target, int counts, int battery_mV, int* out) {
  fw::Parameters parameters;
  for (uint8_t i = 0; i < fw::kFirstRobotParameter; ++i) {
    if (parameters.Set(i, static_cast<int16_t>(values[i])) != fw::AckStatus::kOk) return -1;
  }
  fw::WheelConfig config;
  parameters.Derive(static_cast<uint16_t>(battery_mV), &config);
  fw::WheelSample sample;
  const int16_t speed = fw::SpeedFromCounts(config.speed, static_cast<int16_t>(counts));
  At<fw::WheelController>(wheel).Step(config, static_cast<int16_t>(target), speed, &sample);
  out[0] = sample.speed_mrad_s;
  out[1] = sample.setpoint_mrad_s;
  out[2] = sample.pwm;
  out[3] = sample.integral_pwm_64;
  return 0;
}
void wheel_track_speed(int wheel, int speed) {
  At<fw::WheelController>(wheel).TrackSpeed(static_cast<int16_t>(speed));
}
/// out: complete state of the controller: integral [Q19 PWM], the model's speed and prediction, set-point
/// [mrad/s].
void wheel_state(int wheel, int32_t* out) {
  struct {
    int32_t integral;
    int16_t speed, predicted, setpoint;
  } state;
  static_assert(sizeof(state) == sizeof(fw::WheelController), "the same members in the same order");
  std::memcpy(&state, &At<fw::WheelController>(wheel), sizeof(state));
  out[0] = state.integral;
  out[1] = state.speed;
  out[2] = state.predicted;
  out[3] = state.setpoint;
}
void derive(const int32_t* values, int battery_mV, int32_t* out) {
  fw::Parameters parameters;
  for (uint8_t i = 0; i < fw::kFirstRobotParameter; ++i) parameters.Set(i, static_cast<int16_t>(values[i]));
  Derive(parameters, static_cast<uint16_t>(battery_mV), out);
}

int host_payload_size(int id) { return fw::HostPayloadSize(static_cast<uint8_t>(id)); }

int product(int a, int b) { return fw::Product(static_cast<int16_t>(a), static_cast<int16_t>(b)); }
int difference(int a, int b) { return fw::Difference(static_cast<int16_t>(a), static_cast<int16_t>(b)); }
int speed_from_counts(int counts, int counts_per_rev) {
  return fw::SpeedFromCounts(fw::MakeSpeedScale(static_cast<uint16_t>(counts_per_rev)),
                             static_cast<int16_t>(counts));
}
int battery_from_sum(int sum) { return fw::BatteryFromSum_mV(static_cast<uint16_t>(sum)); }
int current_from_sum(int sum, int scale, int zero) {
  return fw::CurrentFromSum_mA(static_cast<uint16_t>(sum), static_cast<int16_t>(scale),
                               static_cast<int16_t>(zero));
}
int supply_ratio(int battery_mV, int nominal_mV) {
  return fw::SupplyRatio(static_cast<uint16_t>(battery_mV), static_cast<uint16_t>(nominal_mV));
}
int ramp_step(int acceleration) { return fw::RampStep(acceleration); }
int ramp(int setpoint, int target, int acceleration, int deceleration) {
  return fw::Ramp(static_cast<int16_t>(setpoint), static_cast<int16_t>(target),
                  fw::MakeRampSteps(static_cast<int16_t>(acceleration), static_cast<int16_t>(deceleration)));
}

int quadrature_new(int ab) {
  const int decoder = New<Quadrature>();
  At<Quadrature>(decoder).Reset(static_cast<uint8_t>(ab));
  return decoder;
}
void quadrature_step(int decoder, int port) { At<Quadrature>(decoder).Step(static_cast<uint8_t>(port)); }
int quadrature_count(int decoder) { return At<Quadrature>(decoder).count(); }
int quadrature_lost(int decoder) { return At<Quadrature>(decoder).lost(); }

struct DrivenSide {
  fw::Side side;
  fw::SideSample sample;
};
int side_new() { return New<DrivenSide>(); }
int side_step(int side, int mode, int value, int count, int reversed, int* out) {
  fw::WheelConfig config;
  fw::Parameters().Derive(7400, &config);
  auto& sample = At<DrivenSide>(side).sample;
  At<DrivenSide>(side).side.Step(static_cast<fw::State>(mode), config, static_cast<int16_t>(value),
                                 static_cast<uint16_t>(count), reversed != 0, &sample);
  out[0] = sample.wheel.setpoint_mrad_s;
  out[1] = sample.wheel.pwm;
  out[2] = sample.wheel.integral_pwm_64;
  return sample.count;
}

int wheel_monitor_new() { return New<fw::WheelMonitor>(); }
int wheel_monitor_step(int monitor, int count, int next_pwm) {
  return static_cast<int>(
      At<fw::WheelMonitor>(monitor).Step(static_cast<uint16_t>(count), static_cast<int16_t>(next_pwm)));
}
int edge_monitor_new() { return New<fw::EdgeMonitor>(); }
int edge_monitor_step(int monitor, int lost) {
  return At<fw::EdgeMonitor>(monitor).Step(static_cast<uint16_t>(lost));
}
int current_monitor_new() { return New<fw::CurrentMonitor>(); }
int current_monitor_step(int monitor, int left, int right, int limit) {
  return At<fw::CurrentMonitor>(monitor).Step(static_cast<int16_t>(left), static_cast<int16_t>(right),
                                              static_cast<int16_t>(limit));
}

int acceleration_new() { return New<fw::AccelerationMonitor>(); }
int acceleration_step(int monitor, int x, int y, int z, int tilt_limit, int impact_limit) {
  const uint8_t reading[] = {static_cast<uint8_t>(x), static_cast<uint8_t>(y), static_cast<uint8_t>(z)};
  return static_cast<int>(At<fw::AccelerationMonitor>(monitor).Step(reading, static_cast<int16_t>(tilt_limit),
                                                                    static_cast<int16_t>(impact_limit)));
}

int gyro_new() { return New<fw::GyroHeading>(); }
int gyro_measure(int gyro, int rate, int stationary) {
  return At<fw::GyroHeading>(gyro).Measure(static_cast<int16_t>(rate), stationary != 0);
}
void gyro_advance(int gyro, int elapsed_ms) {
  At<fw::GyroHeading>(gyro).Advance(static_cast<uint8_t>(elapsed_ms));
}
int gyro_calibrated(int gyro) { return At<fw::GyroHeading>(gyro).calibrated(); }
int gyro_heading(int gyro) { return At<fw::GyroHeading>(gyro).heading(); }

int crc16(const uint8_t* data, int size) {
  uint16_t crc = fw::kCrcInit;
  for (int i = 0; i < size; ++i) crc = fw::Crc16(crc, data[i]);
  return crc;
}
/// body: id, seq, payload, two spare bytes. Return the frame's size.
int frame_encode(uint8_t* body, int size, uint8_t* out) {
  Bytes sink;
  fw::SendBody(sink, body, static_cast<uint8_t>(size));
  std::memcpy(out, sink.data.data(), sink.data.size());
  return static_cast<int>(sink.data.size());
}
int decoder_new() { return New<Decoder>(); }
int decoder_push(int decoder, int byte) { return At<Decoder>(decoder).Push(static_cast<uint8_t>(byte)); }
/// out: id, seq, payload of the frame just decoded. Return their size.
int decoder_frame(int decoder, uint8_t* out) {
  const auto& frame = At<Decoder>(decoder);
  out[0] = frame.id();
  out[1] = frame.seq();
  std::memcpy(out + 2, frame.payload(), frame.payload_size());
  return 2 + frame.payload_size();
}
int decoder_frames(int decoder) { return At<Decoder>(decoder).frames(); }
int decoder_errors(int decoder) { return At<Decoder>(decoder).errors(); }

int supervisor_new() { return New<fw::Supervisor>(); }
int supervisor_handle(int supervisor, int event, int battery) {
  auto& machine = At<fw::Supervisor>(supervisor);
  return static_cast<int>(machine.Handle(static_cast<fw::Event>(event), static_cast<fw::AckStatus>(battery)));
}
void supervisor_relatch(int supervisor, int fault) {
  At<fw::Supervisor>(supervisor).Relatch(static_cast<fw::Fault>(fault));
}
void supervisor_trip(int supervisor, int fault) {
  At<fw::Supervisor>(supervisor).Trip(static_cast<fw::Fault>(fault));
}
int supervisor_state(int supervisor) { return static_cast<int>(At<fw::Supervisor>(supervisor).state()); }
int supervisor_fault(int supervisor) { return static_cast<int>(At<fw::Supervisor>(supervisor).fault()); }

int battery_new() { return New<fw::Battery>(); }
int battery_update(int battery, int reading) {
  return static_cast<int>(
      At<fw::Battery>(battery).Update(static_cast<uint16_t>(reading), fw::Parameters().battery_limits()));
}
int battery_filtered(int battery) { return At<fw::Battery>(battery).filtered_mV(); }
int battery_warning(int battery) { return At<fw::Battery>(battery).warning(); }
int battery_status(int battery) { return static_cast<int>(At<fw::Battery>(battery).status()); }

int eeprom_new() { return New<Eeprom>(); }
uint8_t* eeprom_cells(int eeprom) { return At<Eeprom>(eeprom).cells; }
void eeprom_copy(int eeprom, uint8_t* out) { std::memcpy(out, eeprom_cells(eeprom), 256); }
void eeprom_set(int eeprom, int address, int byte) {
  eeprom_cells(eeprom)[address] = static_cast<uint8_t>(byte);
}
void eeprom_power(int eeprom, int writes) { At<Eeprom>(eeprom).writes_left = writes; }
int eeprom_writes_left(int eeprom) { return At<Eeprom>(eeprom).writes_left; }

int low_battery_beeps() { return fw::kLowBatteryBeeps; }
int beep_new() { return New<fw::BeepPattern>(); }
void beep_start(int beep, int beeps) { At<fw::BeepPattern>(beep).Start(static_cast<uint8_t>(beeps)); }
int beep_step(int beep, int elapsed_ms, int quiet) {
  return At<fw::BeepPattern>(beep).Step(static_cast<uint8_t>(elapsed_ms), quiet != 0);
}

/// A HostInterface after a start with this reset cause, this previously latched fault and this EEPROM.
int host_new(int cause, int latched, int eeprom) {
  return New<Interface>(static_cast<fw::ResetCause>(cause), static_cast<fw::Fault>(latched),
                        &At<Eeprom>(eeprom));
}
/// The same on a Nano, after power on.
int host_new_nano(int eeprom) {
  return New<Interface>(fw::ResetCause::kPowerOn, fw::Fault::kNone, &At<Eeprom>(eeprom), fw::Board::kNano);
}
/// Feed bytes and write the answers to out (room for 30 bytes per byte fed). Return their size.
int host_receive(int host, const uint8_t* data, int size, uint8_t* out) {
  Bytes sink;
  for (int i = 0; i < size; ++i)
    At<Interface>(host).handled += At<Interface>(host).host.Receive(data[i], sink);
  std::memcpy(out, sink.data.data(), sink.data.size());
  return static_cast<int>(sink.data.size());
}
/// One pass of the save and load work. Return the size of the answers in out.
int host_step_store(int host, uint8_t* out) {
  Bytes sink;
  At<Interface>(host).host.StepStore(*At<Interface>(host).eeprom, sink);
  std::memcpy(out, sink.data.data(), sink.data.size());
  return static_cast<int>(sink.data.size());
}
/// The control tick's constants after a change of parameters or battery; out as for derive().
void host_derive(int host, int32_t* out) {
  const auto& interface = At<Interface>(host).host;
  Derive(interface.parameters(), interface.battery_mV(), out);
}
/// Bits 0 to 3 as in the identity: what the motor drive and the control tick get.
int host_reversed(int host) {
  const fw::Parameters& parameters = At<Interface>(host).host.parameters();
  fw::WheelConfig config;
  parameters.Derive(7400, &config);
  return parameters.IsSet(fw::Parameter::kLeftMotorReversed) |
         parameters.IsSet(fw::Parameter::kRightMotorReversed) << 1 | config.left_encoder_reversed << 2 |
         config.right_encoder_reversed << 3;
}
int host_take_change(int host) { return At<Interface>(host).host.TakeChange(); }
void host_advance_time(int host, int elapsed_ms) {
  At<Interface>(host).host.AdvanceTime(static_cast<uint8_t>(elapsed_ms));
}
int host_battery(int host, int reading) {
  return At<Interface>(host).host.UpdateBattery(static_cast<uint16_t>(reading));
}
void host_inputs(int host, int levels) {
  At<Interface>(host).host.UpdateInputs(static_cast<uint8_t>(levels));
}
void host_acceleration(int host, int x, int y, int z) {
  const uint8_t reading[] = {static_cast<uint8_t>(x), static_cast<uint8_t>(y), static_cast<uint8_t>(z)};
  At<Interface>(host).host.UpdateAcceleration(reading);
}
void host_lose_analog(int host) { At<Interface>(host).host.LoseAnalogReadings(); }
void host_dropped(int host, int ticks) { At<Interface>(host).host.CountDropped(static_cast<uint8_t>(ticks)); }
void host_currents(int host, int left, int right) {
  At<Interface>(host).host.UpdateCurrents(static_cast<int16_t>(left), static_cast<int16_t>(right));
}
/// Samples of a control tick: counts, PWM and lost edges.
void host_watch(int host, int left, int right, int left_pwm, int right_pwm, int lost) {
  auto& interface = At<Interface>(host).host;
  auto* samples = interface.samples();
  samples->time_us += fw::kTick_us;
  samples->left.count = left;
  samples->right.count = right;
  samples->left.wheel.pwm = static_cast<int16_t>(left_pwm);
  samples->right.wheel.pwm = static_cast<int16_t>(right_pwm);
  samples->lost_edges = static_cast<uint16_t>(lost);
  interface.Watch();
}
int host_telemetry(int host, uint8_t* out) {
  Bytes sink;
  At<Interface>(host).host.SendTelemetry(sink, 0x1234, fw::GyroscopeState::kReady);
  std::memcpy(out, sink.data.data(), sink.data.size());
  return static_cast<int>(sink.data.size());
}
int host_handled(int host) { return At<Interface>(host).handled; }
int host_rx_errors(int host) { return At<Interface>(host).host.rx_errors(); }
void host_speeds(int host, int left, int right) {
  auto* samples = At<Interface>(host).host.samples();
  samples->left.wheel.speed_mrad_s = static_cast<int16_t>(left);
  samples->right.wheel.speed_mrad_s = static_cast<int16_t>(right);
}
void host_setpoints(int host, int left, int right) {
  auto* samples = At<Interface>(host).host.samples();
  samples->left.wheel.setpoint_mrad_s = static_cast<int16_t>(left);
  samples->right.wheel.setpoint_mrad_s = static_cast<int16_t>(right);
}
int host_quiet(int host) { return At<Interface>(host).host.quiet(); }
int host_stationary(int host) { return At<Interface>(host).host.stationary(); }
/// out: state, fault, mode, left, right.
void host_status(int host, int* out) {
  const auto& interface = At<Interface>(host).host;
  out[0] = static_cast<int>(interface.supervisor().state());
  out[1] = static_cast<int>(interface.supervisor().fault());
  out[2] = static_cast<int>(interface.command().mode);
  out[3] = interface.command().left;
  out[4] = interface.command().right;
}

int vectors_run(int32_t* out, int room) {
  Words sink;
  vectors::Run(sink);
  const int size = static_cast<int>(sink.data.size());
  if (size <= room) std::memcpy(out, sink.data.data(), sizeof(int32_t) * size);
  return size;
}

}  // extern "C"
