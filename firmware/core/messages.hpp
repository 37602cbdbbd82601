// Generated from firmware/protocol/messages.toml by generate.py: edit that file, not this one.
// clang-format off
#pragma once
#include <stddef.h>
#include <stdint.h>

namespace fw {

constexpr uint32_t kSchemaHash = 0x69B7F337UL;
constexpr size_t kMaxHostPayload = 4;  ///< [bytes] largest payload the host sends
constexpr size_t kMaxPayload = 43;     ///< [bytes] largest payload of all

/// What the host may ask of the supervisor.
enum class Command : uint8_t {
  kDisarm = 0,  ///< Motors off.
  kArm = 1,  ///< Closed loop, starting from set-point zero.
  kEStop = 2,  ///< Motors off and latched until CLEAR_FAULT.
  kClearFault = 3,  ///< Unlatch the fault; the robot is then disarmed.
  kSave = 4,  ///< Write the live parameters to the EEPROM; answered once they are read back.
  kLoad = 5,  ///< Take the saved parameters (the defaults, where none were saved); refused while armed.
  kRestoreDefaults = 6,  ///< Take the default parameters; what is saved stays.
};
constexpr uint8_t kCommandCount = 7;

/// The supervisor's state.
enum class State : uint8_t {
  kDisarmed = 0,  ///< Motors off; the state after reset.
  kClosedLoop = 1,  ///< Wheel speeds are controlled.
  kManual = 2,  ///< Motor PWM is set directly; overrides the closed loop.
  kFault = 3,  ///< Motors off; latched, the fault says why.
};
constexpr uint8_t kStateCount = 4;

/// Why the motors were stopped; latched.
enum class Fault : uint8_t {
  kNone = 0,  ///< No fault.
  kLinkLost = 1,  ///< No motion command for 300 ms while armed.
  kLowBattery = 2,  ///< Battery below 6.4 V; clears only above 7.0 V.
  kEStop = 3,  ///< Stopped by the host's E_STOP command.
  kStallLeft = 4,  ///< Pushed by 38 PWM s and fewer than 3 counts: blocked, or encoder or motor dead.
  kStallRight = 5,  ///< Likewise.
  kReversedLeft = 6,  ///< Likewise, and it counts the other way: encoder or motor wires swapped.
  kReversedRight = 7,  ///< Likewise.
  kLostEdges = 8,  ///< More than 30 encoder edges lost in 300 ms while armed: noise or a loose wire.
  kOverCurrent = 9,  ///< A motor current above current_limit for 0.3 s.
  kWatchdog = 10,  ///< The firmware hung and was restarted.
  kBadParameters = 11,  ///< What the EEPROM holds cannot be read; the defaults are in use.
};
constexpr uint8_t kFaultCount = 12;

/// The answer to a request.
enum class AckStatus : uint8_t {
  kOk = 0,  ///< Done (or already so).
  kUnknownCommand = 1,  ///< No such command.
  kUnknownParameter = 2,  ///< No parameter has this index.
  kOutOfRange = 3,  ///< Value outside the parameter's range; the old one stays.
  kFaultLatched = 4,  ///< Refused while a fault is latched: clear it first.
  kBatteryLow = 5,  ///< Refused until the battery is above 7.0 V.
  kNotSaved = 6,  ///< The EEPROM does not hold what was written to it.
  kBatteryUnknown = 7,  ///< Refused until the first battery reading, 0.1 s after the start: ask again.
  kArmed = 8,  ///< Refused while armed: disarm first.
  kBadParameters = 9,  ///< What the EEPROM holds cannot be read; the live parameters stay.
};
constexpr uint8_t kAckStatusCount = 10;

/// The board the firmware was built for.
enum class Board : uint8_t {
  kTrex = 1,  ///< DAGU T'REX DG010 (ATmega328P, 16 MHz).
  kNano = 2,  ///< Arduino Nano or Uno with a TB6612 or L298N driver.
};
constexpr uint8_t kBoardCount = 2;

/// Why the board last started.
enum class ResetCause : uint8_t {
  kUnknown = 0,  ///< A boot loader cleared the flags.
  kPowerOn = 1,  ///< Power came on.
  kExternal = 2,  ///< Reset pin; opening the port does this.
  kBrownOut = 3,  ///< Supply dipped.
  kWatchdog = 4,  ///< The firmware hung; the watchdog stopped the motors and restarted it.
};
constexpr uint8_t kResetCauseCount = 5;

/// What the parameters were last taken from, or saved to.
enum class ParameterSource : uint8_t {
  kDefaults = 0,  ///< The firmware's own.
  kSaved = 1,  ///< The EEPROM.
};
constexpr uint8_t kParameterSourceCount = 2;

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the wire is little-endian, and so must the machine be");

// Messages are packed: they lie in memory as they go over the wire.

/// Ask for `identity`.
struct __attribute__((packed)) Identify {
  static constexpr uint8_t kId = 0x01;
  static constexpr size_t kSize = 0;
};

/// Wheel-speed set-points; in CLOSED_LOOP they act and feed the link time-out. No answer.
struct __attribute__((packed)) SetWheelSpeeds {
  static constexpr uint8_t kId = 0x02;
  static constexpr size_t kSize = 4;
  int16_t left;  ///< [mrad/s] Left side, forward positive; limited to +-17 rad/s.
  int16_t right;  ///< [mrad/s] Right side, likewise.
};

/// Open-loop PWM; takes an armed robot to MANUAL and feeds the link time-out there. No answer.
struct __attribute__((packed)) SetMotorPwm {
  static constexpr uint8_t kId = 0x03;
  static constexpr size_t kSize = 4;
  int16_t left;  ///< [PWM] Left side, forward positive; limited to +-255.
  int16_t right;  ///< [PWM] Right side, likewise.
};

/// A command to the supervisor; answered by `ack`.
struct __attribute__((packed)) CommandRequest {
  static constexpr uint8_t kId = 0x04;
  static constexpr size_t kSize = 1;
  Command command;  ///< What to do.
};

/// Set a parameter, until the next reset or for good (SAVE); answered by `ack`. Out of range:
/// refused.
struct __attribute__((packed)) SetParameter {
  static constexpr uint8_t kId = 0x05;
  static constexpr size_t kSize = 3;
  uint8_t index;  ///< The parameter.
  int16_t value;  ///< Its value times its scale, rounded.
};

/// Ask for one parameter; answered by `parameter_value`, or by `ack` with UNKNOWN_PARAMETER.
struct __attribute__((packed)) GetParameter {
  static constexpr uint8_t kId = 0x06;
  static constexpr size_t kSize = 1;
  uint8_t index;  ///< The parameter.
};

/// Who is there.
struct __attribute__((packed)) Identity {
  static constexpr uint8_t kId = 0x81;
  static constexpr size_t kSize = 17;
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
  ParameterSource parameters;  ///< What they were last taken from, or saved to.
};

/// Sent once a control tick. Speeds and set-points belong to the interval just ended.
struct __attribute__((packed)) Telemetry {
  static constexpr uint8_t kId = 0x82;
  static constexpr size_t kSize = 43;
  uint32_t time_us;  ///< [us] Time of the tick since reset; wraps.
  int32_t left_count;  ///< [count] Encoder position, rises forward; wraps.
  int16_t left_speed;  ///< [mrad/s] Counts of the interval as a speed.
  int16_t left_setpoint;  ///< [mrad/s] Ramped set-point of the same interval.
  int16_t left_pwm;  ///< [PWM] Output set at this tick, held until the next.
  int16_t left_integral;  ///< [PWM/64] Integral part of the output.
  int32_t right_count;  ///< [count] Likewise.
  int16_t right_speed;  ///< [mrad/s] Likewise.
  int16_t right_setpoint;  ///< [mrad/s] Likewise.
  int16_t right_pwm;  ///< [PWM] Likewise.
  int16_t right_integral;  ///< [PWM/64] Likewise.
  uint16_t lost_edges;  ///< Encoder transitions of unknown direction since reset, both wheels; wraps.
  uint16_t battery_mV;  ///< [mV] Filtered battery voltage; 0 before the first reading.
  int16_t left_current_mA;  ///< [mA] Motor current, averaged over 96 ms.
  int16_t right_current_mA;  ///< [mA] Likewise.
  State state;  ///< Supervisor state.
  Fault fault;  ///< Latched fault.
  uint8_t warnings;  ///< Bit 0: battery below 7.0 V.
  uint16_t rx_frames;  ///< Good frames received since reset; wraps.
  uint16_t rx_errors;  ///< Frames refused since reset; a lost byte spoils its frame; wraps.
};

/// The answer to a request.
struct __attribute__((packed)) Ack {
  static constexpr uint8_t kId = 0x83;
  static constexpr size_t kSize = 3;
  uint8_t request_id;  ///< Message id of the request.
  uint8_t request_seq;  ///< Its sequence number.
  AckStatus status;  ///< What became of it.
};

/// One parameter's present value; carries the sequence number of the request it answers.
struct __attribute__((packed)) ParameterValue {
  static constexpr uint8_t kId = 0x84;
  static constexpr size_t kSize = 3;
  uint8_t index;  ///< The parameter.
  int16_t value;  ///< Its value times its scale.
};

/// Payload size of a message that the host sends; 0xFF for every other id. `identify` may have any.
constexpr uint8_t HostPayloadSize(uint8_t id) {
  switch (id) {
    case 0x01: return 0;  // identify
    case 0x02: return 4;  // set_wheel_speeds
    case 0x03: return 4;  // set_motor_pwm
    case 0x04: return 1;  // command_request
    case 0x05: return 3;  // set_parameter
    case 0x06: return 1;  // get_parameter
    default: return 0xFF;
  }
}

/// The live parameters, by index.
enum class Parameter : uint8_t {
  kKp = 0,  ///< [PWM/(rad/s) * 524.288] Proportional gain.
  kKi = 1,  ///< [PWM/(rad/s) per tick * 524.288] Integral gain; added once a control tick.
  kKs = 2,  ///< [PWM * 128.0] Feed-forward against dry friction, at 7.4 V.
  kKv = 3,  ///< [PWM/(rad/s) * 524.288] Feed-forward per speed, at 7.4 V. 0 switches ka and the speed prediction off too.
  kKa = 4,  ///< [PWM/(rad/s^2) * 524.288] Feed-forward per acceleration, at 7.4 V; ka / kv is the wheel's time constant.
  kAcceleration = 5,  ///< [rad/s^2 * 100.0] Limit of the set-point ramp; 0 = no ramp.
  kCurrentLimit = 6,  ///< [A * 1000.0] A motor current above it for 0.3 s is a fault; the sensor ends at 20 A.
};
constexpr uint8_t kParameterCount = 7;

/// Range and start value of a parameter, on the wire's scale.
struct ParameterRange {
  int16_t minimum, maximum, initial;
};
constexpr ParameterRange kParameterRanges[kParameterCount] = {
    {0, 31457, 3198},  // kp
    {0, 15729, 5715},  // ki
    {0, 12800, 2470},  // ks
    {0, 31457, 8976},  // kv
    {0, 10486, 673},  // ka
    {0, 20000, 800},  // acceleration
    {1000, 20000, 8000},  // current_limit
};

}  // namespace fw
