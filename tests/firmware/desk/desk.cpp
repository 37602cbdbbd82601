// The firmware's core for this machine, behind C functions of plain ints, so that Python needs no
// declarations. Objects are numbered; `*_new` returns the number.

#include <cstring>
#include <deque>
#include <vector>

#include "core/host_interface.hpp"
#include "core/quadrature.hpp"
#include "vectors.hpp"

namespace {

template <typename T>
std::deque<T>& Pool() {
  static std::deque<T> pool;
  return pool;
}

template <typename T, typename... Args>
int New(Args... args) {
  Pool<T>().emplace_back(args...);
  return static_cast<int>(Pool<T>().size()) - 1;
}

struct Bytes {
  std::vector<uint8_t> data;
  void Put(uint8_t byte) { data.push_back(byte); }
};

struct Words {
  std::vector<int32_t> data;
  void Put(int32_t word) { data.push_back(word); }
};

using Decoder = fw::FrameDecoder<60>;

}  // namespace

extern "C" {

int pi_new() { return New<fw::PiController>(); }
int pi_step(int pi, int kp, int ki, int error, int feed_forward, int idle) {
  const fw::PiGains gains = {static_cast<int16_t>(kp), static_cast<int16_t>(ki)};
  return Pool<fw::PiController>()[pi].Step(gains, error, feed_forward, idle != 0);
}
int pi_integral(int pi) { return Pool<fw::PiController>()[pi].integral(); }

/// parameters: kParameterCount wire values. out: speed, set-point, PWM, integral.
int wheel_new() { return New<fw::WheelController>(); }
int wheel_step(int wheel, const int32_t* values, int target, int counts, int battery_mV, int* out) {
  fw::Parameters parameters;
  for (uint8_t i = 0; i < fw::kParameterCount; ++i) {
    if (parameters.Set(i, values[i]) != fw::AckStatus::kOk) return -1;
  }
  auto& controller = Pool<fw::WheelController>()[wheel];
  const auto sample =
      controller.Step(parameters.Derive(), static_cast<int16_t>(target), static_cast<int16_t>(counts),
                      fw::SupplyRatio(static_cast<uint16_t>(battery_mV)));
  out[0] = sample.speed_mrad_s;
  out[1] = sample.setpoint_mrad_s;
  out[2] = sample.pwm;
  out[3] = controller.integral_pwm_64();
  return 0;
}

int speed_from_counts(int counts) { return fw::SpeedFromCounts(static_cast<int16_t>(counts)); }
int battery_from_sum(int sum) { return fw::BatteryFromSum_mV(static_cast<uint16_t>(sum)); }
int current_from_sum(int sum) { return fw::CurrentFromSum_mA(static_cast<uint16_t>(sum)); }
int supply_ratio(int battery_mV) { return fw::SupplyRatio(static_cast<uint16_t>(battery_mV)); }
int ramp_step(int acceleration) { return fw::RampStep(acceleration); }
int ramp(int setpoint, int target, int step) {
  return fw::Ramp(static_cast<int16_t>(setpoint), static_cast<int16_t>(target), static_cast<int16_t>(step));
}
/// out: lead (Q10), now, previous (Q13).
void derive_feed_forward(int ks, int kv, int ka, int* out) {
  const auto gains =
      fw::DeriveFeedForward(static_cast<int16_t>(ks), static_cast<int16_t>(kv), static_cast<int16_t>(ka));
  out[0] = gains.lead;
  out[1] = gains.now;
  out[2] = gains.previous;
}

int quadrature_new(int ab) {
  const int decoder = New<fw::QuadratureDecoder>();
  Pool<fw::QuadratureDecoder>()[decoder].Reset(static_cast<uint8_t>(ab));
  return decoder;
}
void quadrature_step(int decoder, int ab) {
  Pool<fw::QuadratureDecoder>()[decoder].Step(static_cast<uint8_t>(ab));
}
int quadrature_count(int decoder) { return Pool<fw::QuadratureDecoder>()[decoder].count(); }
int quadrature_lost(int decoder) { return Pool<fw::QuadratureDecoder>()[decoder].lost(); }

int side_new() { return New<fw::Side>(); }
int side_count(int side, int count) {
  const fw::DriveInput off = {};
  return Pool<fw::Side>()[side].Step(off, 0, static_cast<uint16_t>(count)).count;
}

int crc16(const uint8_t* data, int size) {
  uint16_t crc = fw::kCrcInit;
  for (int i = 0; i < size; ++i) crc = fw::Crc16(crc, data[i]);
  return crc;
}
/// body: id, seq, payload, two spare bytes. Returns the frame's size.
int frame_encode(uint8_t* body, int size, uint8_t* out) {
  Bytes sink;
  fw::SendBody(sink, body, static_cast<uint8_t>(size));
  std::memcpy(out, sink.data.data(), sink.data.size());
  return static_cast<int>(sink.data.size());
}
int decoder_new() { return New<Decoder>(); }
int decoder_push(int decoder, int byte) { return Pool<Decoder>()[decoder].Push(static_cast<uint8_t>(byte)); }
/// out: id, seq, payload of the frame just completed. Returns their size.
int decoder_frame(int decoder, uint8_t* out) {
  const auto& frame = Pool<Decoder>()[decoder];
  out[0] = frame.id();
  out[1] = frame.seq();
  std::memcpy(out + 2, frame.payload(), frame.payload_size());
  return 2 + frame.payload_size();
}
int decoder_errors(int decoder) { return Pool<Decoder>()[decoder].errors(); }

int supervisor_new() { return New<fw::Supervisor>(); }
int supervisor_handle(int supervisor, int event, int battery_low) {
  auto& machine = Pool<fw::Supervisor>()[supervisor];
  return static_cast<int>(machine.Handle(static_cast<fw::Event>(event), battery_low != 0));
}
int supervisor_state(int supervisor) { return static_cast<int>(Pool<fw::Supervisor>()[supervisor].state()); }
int supervisor_fault(int supervisor) { return static_cast<int>(Pool<fw::Supervisor>()[supervisor].fault()); }

int battery_new() { return New<fw::Battery>(); }
int battery_update(int battery, int reading) {
  return Pool<fw::Battery>()[battery].Update(static_cast<uint16_t>(reading));
}
int battery_filtered(int battery) { return Pool<fw::Battery>()[battery].filtered_mV(); }
int battery_low(int battery) { return Pool<fw::Battery>()[battery].low(); }

int host_new() { return New<fw::HostInterface>(fw::Board::kTrex, fw::ResetCause::kPowerOn); }
/// Feed bytes; the answers' bytes go to out (room for 30 a byte fed). Returns their size.
int host_receive(int host, const uint8_t* data, int size, uint8_t* out) {
  Bytes sink;
  for (int i = 0; i < size; ++i) Pool<fw::HostInterface>()[host].Receive(data[i], sink);
  std::memcpy(out, sink.data.data(), sink.data.size());
  return static_cast<int>(sink.data.size());
}
void host_wait(int host, int elapsed_ms) {
  Pool<fw::HostInterface>()[host].Wait(static_cast<uint8_t>(elapsed_ms));
}
int host_battery(int host, int reading) {
  return Pool<fw::HostInterface>()[host].UpdateBattery(static_cast<uint16_t>(reading));
}
int host_rx_errors(int host) { return Pool<fw::HostInterface>()[host].rx_errors(); }
/// out: state, fault, mode, left, right.
void host_status(int host, int* out) {
  const auto& interface = Pool<fw::HostInterface>()[host];
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
