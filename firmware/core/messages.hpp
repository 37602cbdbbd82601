// Generated from firmware/protocol/messages.toml by generate.py: edit that file, not this one.
// clang-format off
#pragma once
#include <stddef.h>
#include <stdint.h>

namespace fw {

constexpr uint32_t kSchemaHash = 0x4EB3CE2CUL;
constexpr size_t kMaxHostPayload = 5;  ///< [bytes] largest payload the host sends
constexpr size_t kMaxPayload = 40;     ///< [bytes] largest payload of all

/// What the host may ask of the supervisor.
enum class Command : uint8_t {
  kDisarm = 0,  ///< Motors off.
  kArm = 1,  ///< Closed loop, starting from set-point zero.
  kEStop = 2,  ///< Motors off and latched until CLEAR_FAULT.
  kClearFault = 3,  ///< Unlatch the fault; the robot is then disarmed.
};

/// The supervisor's state.
enum class State : uint8_t {
  kDisarmed = 0,  ///< Motors off; the state after reset.
  kClosedLoop = 1,  ///< Wheel speeds are controlled.
  kManual = 2,  ///< Motor PWM is set directly; overrides the closed loop.
  kFault = 3,  ///< Motors off; latched, the fault says why.
};

/// Why the motors were stopped; latched.
enum class Fault : uint8_t {
  kNone = 0,  ///< No fault.
  kLinkLost = 1,  ///< No motion command for 300 ms while armed.
  kLowBattery = 2,  ///< Battery below 6.4 V; clears only above 7.0 V.
  kEStop = 3,  ///< Stopped by the host's E_STOP command.
};

/// The answer to a request.
enum class AckStatus : uint8_t {
  kOk = 0,  ///< Done (or already so).
  kUnknownCommand = 1,  ///< No such command.
  kUnknownParameter = 2,  ///< No parameter has this index.
  kOutOfRange = 3,  ///< Value outside the parameter's range; the old one stays.
  kFaultLatched = 4,  ///< Refused while a fault is latched: clear it first.
  kBatteryLow = 5,  ///< Refused until the battery is above 7.0 V.
};

/// The board the firmware was built for.
enum class Board : uint8_t {
  kTrex = 1,  ///< DAGU T'REX DG010 (ATmega328P, 16 MHz).
  kNano = 2,  ///< Arduino Nano or Uno with a TB6612 or L298N driver.
};

/// Why the board last started.
enum class ResetCause : uint8_t {
  kUnknown = 0,  ///< A boot loader cleared the flags.
  kPowerOn = 1,  ///< Power came on.
  kExternal = 2,  ///< Reset pin; opening the port does this.
  kBrownOut = 3,  ///< Supply dipped.
  kWatchdog = 4,  ///< Watchdog reset.
};

namespace wire {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the wire is little-endian, and so must the machine be");

template <typename T>
inline uint8_t* Put(uint8_t* out, T value) {
  __builtin_memcpy(out, &value, sizeof(T));
  return out + sizeof(T);
}

template <typename T>
inline const uint8_t* Get(const uint8_t* in, T* value) {
  __builtin_memcpy(value, in, sizeof(T));
  return in + sizeof(T);
}

}  // namespace wire

/// Ask for `identity`.
struct Identify {
  static constexpr uint8_t kId = 0x01;
  static constexpr size_t kSize = 0;
};

/// Wheel-speed set-points; in CLOSED_LOOP they act and feed the link time-out. No answer.
struct SetWheelSpeeds {
  static constexpr uint8_t kId = 0x02;
  static constexpr size_t kSize = 4;
  int16_t left;  ///< [mrad/s] Left side, forward positive; limited to +-17 rad/s.
  int16_t right;  ///< [mrad/s] Right side, likewise.

  static SetWheelSpeeds Unpack(const uint8_t* in) {
    SetWheelSpeeds message;
    in = wire::Get(in, &message.left);
    wire::Get(in, &message.right);
    return message;
  }
};

/// Open-loop PWM; takes an armed robot to MANUAL and feeds the link time-out there. No answer.
struct SetMotorPwm {
  static constexpr uint8_t kId = 0x03;
  static constexpr size_t kSize = 4;
  int16_t left;  ///< [PWM] Left side, forward positive; limited to +-255.
  int16_t right;  ///< [PWM] Right side, likewise.

  static SetMotorPwm Unpack(const uint8_t* in) {
    SetMotorPwm message;
    in = wire::Get(in, &message.left);
    wire::Get(in, &message.right);
    return message;
  }
};

/// A command to the supervisor; answered by `ack`.
struct CommandRequest {
  static constexpr uint8_t kId = 0x04;
  static constexpr size_t kSize = 1;
  Command command;  ///< What to do.

  static CommandRequest Unpack(const uint8_t* in) {
    CommandRequest message;
    wire::Get(in, &message.command);
    return message;
  }
};

/// Set a parameter until the next reset; answered by `ack`. Out of range changes nothing.
struct SetParameter {
  static constexpr uint8_t kId = 0x05;
  static constexpr size_t kSize = 5;
  uint8_t index;  ///< The parameter.
  int32_t value;  ///< Its value times its scale, rounded.

  static SetParameter Unpack(const uint8_t* in) {
    SetParameter message;
    in = wire::Get(in, &message.index);
    wire::Get(in, &message.value);
    return message;
  }
};

/// Ask for one parameter; answered by `parameter_value`, or by `ack` with UNKNOWN_PARAMETER.
struct GetParameter {
  static constexpr uint8_t kId = 0x06;
  static constexpr size_t kSize = 1;
  uint8_t index;  ///< The parameter.

  static GetParameter Unpack(const uint8_t* in) {
    GetParameter message;
    wire::Get(in, &message.index);
    return message;
  }
};

/// Who is there.
struct Identity {
  static constexpr uint8_t kId = 0x81;
  static constexpr size_t kSize = 16;
  uint32_t schema_hash;  ///< CRC-32 of this schema; first in every version, for ever.
  uint8_t version_major;  ///< Firmware version.
  uint8_t version_minor;  ///< Firmware version.
  uint8_t version_patch;  ///< Firmware version.
  Board board;  ///< Board the firmware was built for.
  uint8_t control_rate_Hz;  ///< [Hz] Control ticks a second.
  ResetCause reset_cause;  ///< Why the board last started.
  uint16_t counts_per_rev;  ///< [count] Encoder counts a wheel turn.
  uint16_t wheel_radius_mm;  ///< [mm] Wheel radius.
  uint16_t track_mm;  ///< [mm] Distance between the middle wheels' contact points.

  void Pack(uint8_t* out) const {
    out = wire::Put(out, schema_hash);
    out = wire::Put(out, version_major);
    out = wire::Put(out, version_minor);
    out = wire::Put(out, version_patch);
    out = wire::Put(out, board);
    out = wire::Put(out, control_rate_Hz);
    out = wire::Put(out, reset_cause);
    out = wire::Put(out, counts_per_rev);
    out = wire::Put(out, wheel_radius_mm);
    wire::Put(out, track_mm);
  }
};

/// Sent once a control tick. Speeds and set-points belong to the interval just ended.
struct Telemetry {
  static constexpr uint8_t kId = 0x82;
  static constexpr size_t kSize = 40;
  uint32_t time_us;  ///< [us] Time of the tick since reset; wraps.
  int32_t left_count;  ///< [count] Encoder position, rises forward; wraps.
  int32_t right_count;  ///< [count] Likewise.
  int16_t left_speed;  ///< [mrad/s] Counts of the interval as a speed.
  int16_t right_speed;  ///< [mrad/s] Likewise.
  int16_t left_setpoint;  ///< [mrad/s] Ramped set-point of the same interval.
  int16_t right_setpoint;  ///< [mrad/s] Likewise.
  int16_t left_pwm;  ///< [PWM] Output set at this tick, held until the next.
  int16_t right_pwm;  ///< [PWM] Likewise.
  int16_t left_integral;  ///< [PWM/64] Integral part of the output.
  int16_t right_integral;  ///< [PWM/64] Likewise.
  uint16_t battery_mV;  ///< [mV] Filtered battery voltage; 0 before the first reading.
  int16_t left_current_mA;  ///< [mA] Motor current, averaged over 96 ms.
  int16_t right_current_mA;  ///< [mA] Likewise.
  State state;  ///< Supervisor state.
  Fault fault;  ///< Latched fault.
  uint16_t rx_errors;  ///< Frames refused or bytes lost since reset; wraps.
  uint16_t lost_edges;  ///< Encoder transitions of unknown direction since reset, both wheels; wraps.

  void Pack(uint8_t* out) const {
    out = wire::Put(out, time_us);
    out = wire::Put(out, left_count);
    out = wire::Put(out, right_count);
    out = wire::Put(out, left_speed);
    out = wire::Put(out, right_speed);
    out = wire::Put(out, left_setpoint);
    out = wire::Put(out, right_setpoint);
    out = wire::Put(out, left_pwm);
    out = wire::Put(out, right_pwm);
    out = wire::Put(out, left_integral);
    out = wire::Put(out, right_integral);
    out = wire::Put(out, battery_mV);
    out = wire::Put(out, left_current_mA);
    out = wire::Put(out, right_current_mA);
    out = wire::Put(out, state);
    out = wire::Put(out, fault);
    out = wire::Put(out, rx_errors);
    wire::Put(out, lost_edges);
  }
};

/// The answer to a request.
struct Ack {
  static constexpr uint8_t kId = 0x83;
  static constexpr size_t kSize = 3;
  uint8_t request_id;  ///< Message id of the request.
  uint8_t request_seq;  ///< Its sequence number.
  AckStatus status;  ///< What became of it.

  void Pack(uint8_t* out) const {
    out = wire::Put(out, request_id);
    out = wire::Put(out, request_seq);
    wire::Put(out, status);
  }
};

/// One parameter's present value; carries the sequence number of the request it answers.
struct ParameterValue {
  static constexpr uint8_t kId = 0x84;
  static constexpr size_t kSize = 5;
  uint8_t index;  ///< The parameter.
  int32_t value;  ///< Its value times its scale.

  void Pack(uint8_t* out) const {
    out = wire::Put(out, index);
    wire::Put(out, value);
  }
};

/// The live parameters, by index.
enum class Parameter : uint8_t {
  kKp = 0,  ///< [PWM/(rad/s) * 524.288] Proportional gain.
  kKi = 1,  ///< [PWM/(rad/s) per tick * 524.288] Integral gain; added once a control tick.
  kKs = 2,  ///< [PWM * 128.0] Feed-forward against dry friction, at 7.4 V.
  kKv = 3,  ///< [PWM/(rad/s) * 524.288] Feed-forward per speed, at 7.4 V. 0 switches ka and the speed prediction off too.
  kKa = 4,  ///< [PWM/(rad/s^2) * 524.288] Feed-forward per acceleration, at 7.4 V; ka / kv is the wheel's time constant.
  kAcceleration = 5,  ///< [rad/s^2 * 1000.0] Limit of the set-point ramp; 0 = no ramp.
};
constexpr uint8_t kParameterCount = 6;

/// Range and start value of a parameter, on the wire's scale.
struct ParameterRange {
  int32_t minimum, maximum, initial;
};
constexpr ParameterRange kParameterRanges[kParameterCount] = {
    {0, 31457, 6082},  // kp
    {0, 15729, 4194},  // ki
    {0, 12800, 2470},  // ks
    {0, 31457, 8976},  // kv
    {0, 10486, 673},  // ka
    {0, 200000, 8000},  // acceleration
};

}  // namespace fw
