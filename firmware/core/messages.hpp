// Generated from firmware/protocol/messages.toml by generate.py: edit that file, not this one.
// clang-format off
#pragma once
#include <stddef.h>
#include <stdint.h>

#include "core/flash.hpp"

namespace fw {

constexpr uint32_t kSchemaHash = 0xDE20ECC9UL;
constexpr size_t kMaxHostPayload = 4;  ///< [bytes] largest payload from the host
constexpr size_t kMaxPayload = 48;     ///< [bytes] largest payload in either direction

/// Commands from the host to the supervisor.
enum class Command : uint8_t {
  kDisarm = 0,  ///< Motors off.
  kArm = 1,  ///< Enter the closed loop with a set-point of zero.
  kEStop = 2,  ///< Emergency stop: motors off, latched until CLEAR_FAULT.
  kClearFault = 3,  ///< Clear the latched fault; the robot is then disarmed.
  kSave = 4,  ///< Write the live parameters to the EEPROM. Answered after they are read back.
  kLoad = 5,  ///< Load the saved parameters (the defaults if none are saved). Refused while armed.
  kRestoreDefaults = 6,  ///< Restore the default parameters. The saved ones stay. Refused while armed.
};
constexpr uint8_t kCommandCount = 7;

/// The supervisor's state.
enum class State : uint8_t {
  kDisarmed = 0,  ///< Motors off; the state after reset.
  kClosedLoop = 1,  ///< Wheel speeds are controlled.
  kManual = 2,  ///< The host sets motor PWM directly; overrides the closed loop.
  kFault = 3,  ///< Motors off, latched; the fault gives the reason.
};
constexpr uint8_t kStateCount = 4;

/// Why the firmware stopped the motors; latched.
enum class Fault : uint8_t {
  kNone = 0,  ///< No fault.
  kLinkLost = 1,  ///< No motion command for 300 ms while armed.
  kLowBattery = 2,  ///< Battery below battery_stop per cell; clears only above battery_rearm.
  kEStop = 3,  ///< The host sent E_STOP.
  kStallLeft = 4,  ///< Fewer than 3 counts after 38 PWM s: blocked, or encoder or motor dead.
  kStallRight = 5,  ///< As STALL_LEFT, for the right side.
  kReversedLeft = 6,  ///< Wrong direction after 38 PWM s: encoder or motor wires swapped.
  kReversedRight = 7,  ///< As REVERSED_LEFT, for the right side.
  kLostEdges = 8,  ///< More than 30 encoder edges lost in 300 ms while armed: noise or a loose wire.
  kOverCurrent = 9,  ///< A motor current above current_limit for 0.3 s.
  kWatchdog = 10,  ///< The firmware hung; the watchdog restarted it.
  kBadParameters = 11,  ///< The saved parameters are invalid; the defaults are in use.
  kAdcStopped = 12,  ///< No analogue reading for 50 ms: battery and motor currents are unknown.
  kHighBattery = 13,  ///< Battery above 4.5 V per cell: another pack, or its voltage divider is broken.
  kInput1 = 14,  ///< Protecting input 1 is active: bumper, cliff sensor or emergency stop.
  kInput2 = 15,  ///< As INPUT_1, for input 2.
  kTilted = 16,  ///< The robot was tilted beyond tilt_limit for 0.3 s while armed.
  kImpact = 17,  ///< An impact above impact_limit while armed.
};
constexpr uint8_t kFaultCount = 18;

/// Result of a request.
enum class AckStatus : uint8_t {
  kOk = 0,  ///< Done, or already in effect.
  kUnknownCommand = 1,  ///< No such command.
  kUnknownParameter = 2,  ///< No parameter has this index.
  kOutOfRange = 3,  ///< Value outside the parameter's range; the old value stays.
  kFaultLatched = 4,  ///< Refused while a fault is latched; send CLEAR_FAULT first.
  kBatteryLow = 5,  ///< Refused until the battery is above battery_rearm per cell.
  kNotSaved = 6,  ///< The EEPROM failed verification after the write.
  kBatteryUnknown = 7,  ///< Refused until the first battery reading, 0.1 s after the start; try again.
  kArmed = 8,  ///< Refused while armed; disarm first.
  kBadParameters = 9,  ///< The saved parameters are invalid; the live parameters stay.
  kBatteryHigh = 10,  ///< Refused while the battery reads above 4.5 V per cell.
  kInputActive = 11,  ///< Refused while a protecting input is active.
  kPinsInUse = 12,  ///< Gyroscope and motor currents cannot both have A4 and A5.
  kNoAccelerometer = 13,  ///< This board has no accelerometer.
};
constexpr uint8_t kAckStatusCount = 14;

/// Board that the firmware was built for.
enum class Board : uint8_t {
  kTrex = 1,  ///< DAGU T'REX DG010 (ATmega328P, 16 MHz).
  kNano = 2,  ///< Arduino Nano or Uno with a TB6612 or L298N driver.
};
constexpr uint8_t kBoardCount = 2;

/// Why the board last started.
enum class ResetCause : uint8_t {
  kUnknown = 0,  ///< The boot loader cleared the reset flags.
  kPowerOn = 1,  ///< Power on.
  kExternal = 2,  ///< Reset pin; opening the serial port triggers it.
  kBrownOut = 3,  ///< Supply voltage dip.
  kWatchdog = 4,  ///< The firmware hung; the watchdog stopped the motors and restarted it.
};
constexpr uint8_t kResetCauseCount = 5;

/// State of the gyroscope.
enum class GyroscopeState : uint8_t {
  kOff = 0,  ///< Not in use: the parameter `gyroscope` is 0.
  kMissing = 1,  ///< No device answers, or it has stopped measuring; the board tries again.
  kCalibrating = 2,  ///< Its bias is unknown until the robot has been stationary for a second.
  kReady = 3,  ///< The heading is valid.
};
constexpr uint8_t kGyroscopeStateCount = 4;

/// Where the parameters were last loaded from or saved to.
enum class ParameterSource : uint8_t {
  kDefaults = 0,  ///< Built-in defaults.
  kSaved = 1,  ///< The EEPROM.
};
constexpr uint8_t kParameterSourceCount = 2;

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "the wire is little-endian, so the machine must be too");

// Messages are packed: their memory layout is the wire layout.

/// Request `identity`.
struct __attribute__((packed)) Identify {
  static constexpr uint8_t kId = 0x01;
  static constexpr size_t kSize = 0;
};

/// Wheel-speed set-points. They apply, and reset the link time-out, only in CLOSED_LOOP. No answer.
struct __attribute__((packed)) SetWheelSpeeds {
  static constexpr uint8_t kId = 0x02;
  static constexpr size_t kSize = 4;
  int16_t left;  ///< [mrad/s] Left side, positive forward, limited to +-17 rad/s.
  int16_t right;  ///< [mrad/s] Right side, positive forward, limited to +-17 rad/s.
};

/// Open-loop motor PWM. Switches an armed robot to MANUAL and resets its link time-out. No answer.
struct __attribute__((packed)) SetMotorPwm {
  static constexpr uint8_t kId = 0x03;
  static constexpr size_t kSize = 4;
  int16_t left;  ///< [PWM] Left side, positive forward, limited to +-255.
  int16_t right;  ///< [PWM] Right side, positive forward, limited to +-255.
};

/// Command to the supervisor; answered by `ack`.
struct __attribute__((packed)) CommandRequest {
  static constexpr uint8_t kId = 0x04;
  static constexpr size_t kSize = 1;
  Command command;  ///< The command.
};

/// Set a live parameter; answered by `ack`. Refused out of range; from `counts_per_rev` on while
/// armed.
struct __attribute__((packed)) SetParameter {
  static constexpr uint8_t kId = 0x05;
  static constexpr size_t kSize = 3;
  uint8_t index;  ///< Parameter index.
  int16_t value;  ///< Value times scale, rounded.
};

/// Request one parameter; answered by `parameter_value`, or by `ack` with UNKNOWN_PARAMETER.
struct __attribute__((packed)) GetParameter {
  static constexpr uint8_t kId = 0x06;
  static constexpr size_t kSize = 1;
  uint8_t index;  ///< Parameter index.
};

/// Firmware version, board and robot constants; the answer to `identify`.
struct __attribute__((packed)) Identity {
  static constexpr uint8_t kId = 0x81;
  static constexpr size_t kSize = 29;
  uint32_t schema_hash;  ///< CRC-32 of this schema; the first field in every version.
  uint8_t version_major;  ///< Firmware version, major.
  uint8_t version_minor;  ///< Firmware version, minor.
  uint8_t version_patch;  ///< Firmware version, patch.
  Board board;  ///< Board that the firmware was built for.
  uint8_t control_rate_Hz;  ///< [Hz] Control rate.
  ResetCause reset_cause;  ///< Why the board last started.
  uint16_t counts_per_rev;  ///< [count] Encoder counts per wheel revolution.
  uint16_t wheel_radius_mm;  ///< [mm] Wheel radius.
  uint16_t track_mm;  ///< [mm] Distance between the middle wheels' contact points.
  uint8_t reversed_sides;  ///< Bits 0 to 3: left motor, right motor, left encoder, right encoder.
  uint8_t battery_cells;  ///< Cells of the battery in series.
  uint16_t battery_stop_mV;  ///< [mV] Voltage per cell below which the motors stop.
  uint16_t battery_rearm_mV;  ///< [mV] Voltage per cell above which the robot may be armed.
  uint16_t current_scale;  ///< [mA/512] Motor current per ADC count.
  uint16_t current_zero;  ///< [count] ADC reading of a motor current of zero.
  uint16_t pwm_frequency_Hz;  ///< [Hz] PWM frequency of the motors.
  ParameterSource parameters;  ///< Where they were last loaded from or saved to.
};

/// Sent once per control tick. Speeds and set-points belong to the interval just ended.
struct __attribute__((packed)) Telemetry {
  static constexpr uint8_t kId = 0x82;
  static constexpr size_t kSize = 48;
  uint32_t time_us;  ///< [us] Time of the tick since reset; wraps.
  int32_t left_count;  ///< [count] Encoder position, increases forward; wraps.
  int16_t left_speed;  ///< [mrad/s] Speed measured from the counts of the interval.
  int16_t left_setpoint;  ///< [mrad/s] Ramped set-point of the same interval.
  int16_t left_pwm;  ///< [PWM] Output from this tick until the next; 0 while a reversed motor rests that long.
  int16_t left_integral;  ///< [PWM/64] Integral term of the output.
  int32_t right_count;  ///< [count] Encoder position, increases forward; wraps.
  int16_t right_speed;  ///< [mrad/s] Speed measured from the counts of the interval.
  int16_t right_setpoint;  ///< [mrad/s] Ramped set-point of the same interval.
  int16_t right_pwm;  ///< [PWM] Output from this tick until the next; 0 while a reversed motor rests that long.
  int16_t right_integral;  ///< [PWM/64] Integral term of the output.
  uint16_t lost_edges;  ///< Encoder transitions of unknown direction since reset, both wheels; wraps.
  uint16_t battery_mV;  ///< [mV] Filtered battery voltage; 0 before the first reading.
  int16_t left_current_mA;  ///< [mA] Motor current, averaged over 96 ms.
  int16_t right_current_mA;  ///< [mA] Motor current, averaged over 96 ms.
  State state;  ///< Supervisor state.
  Fault fault;  ///< Latched fault.
  uint8_t warnings;  ///< Bit 0: battery below battery_rearm.
  uint16_t rx_frames;  ///< Valid frames received since reset; wraps.
  uint16_t rx_errors;  ///< Frames rejected since reset; wraps. One lost byte invalidates its frame.
  uint16_t tx_dropped;  ///< Control ticks without telemetry since reset, because the line was busy; wraps.
  uint16_t heading;  ///< [rev/65536] Heading by the gyroscope, counter-clockwise; wraps. Arbitrary before READY.
  GyroscopeState gyroscope;  ///< State of the gyroscope.
};

/// Answer to a request.
struct __attribute__((packed)) Ack {
  static constexpr uint8_t kId = 0x83;
  static constexpr size_t kSize = 3;
  uint8_t request_id;  ///< Message id of the request.
  uint8_t request_seq;  ///< Sequence number of the request.
  AckStatus status;  ///< Result.
};

/// Current value of one parameter, with the sequence number of the request.
struct __attribute__((packed)) ParameterValue {
  static constexpr uint8_t kId = 0x84;
  static constexpr size_t kSize = 3;
  uint8_t index;  ///< Parameter index.
  int16_t value;  ///< Value times scale.
};

/// Return the payload size of a message from the host, or 0xFF for any other id. `identify` may have any size.
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
  kKi = 1,  ///< [PWM/(rad/s) per tick * 524.288] Integral gain, applied once per control tick.
  kKs = 2,  ///< [PWM * 128.0] Feed-forward for static friction, at 3.7 V per cell.
  kKv = 3,  ///< [PWM/(rad/s) * 524.288] Feed-forward for speed, at 3.7 V per cell. 0 also disables ka and the speed prediction.
  kKa = 4,  ///< [PWM/(rad/s^2) * 524.288] Feed-forward for acceleration, at 3.7 V per cell. ka / kv is the wheel's time constant.
  kAcceleration = 5,  ///< [rad/s^2 * 100.0] Acceleration limit of the set-point ramp; 0 = no ramp.
  kDeceleration = 6,  ///< [rad/s^2 * 100.0] Deceleration limit of the set-point ramp; 0 = as acceleration.
  kCurrentLimit = 7,  ///< [A * 1000.0] A motor current above this for 0.3 s is a fault. The sensor measures up to 20 A.
  kCountsPerRev = 8,  ///< [count * 1.0] Encoder counts per wheel revolution.
  kWheelRadius = 9,  ///< [mm * 1.0] Wheel radius.
  kTrack = 10,  ///< [mm * 1.0] Distance between the middle wheels' contact points.
  kLeftMotorReversed = 11,  ///< [ * 1.0] 1: the left motor runs forward when its pins say reverse.
  kRightMotorReversed = 12,  ///< [ * 1.0] 1: the right motor runs forward when its pins say reverse.
  kLeftEncoderReversed = 13,  ///< [ * 1.0] 1: the left encoder counts down while the wheel rolls forward.
  kRightEncoderReversed = 14,  ///< [ * 1.0] 1: the right encoder counts down while the wheel rolls forward.
  kBatteryCells = 15,  ///< [ * 1.0] Battery cells in series. Above 4.5 V per cell is a fault.
  kBatteryStop = 16,  ///< [V * 1000.0] Voltage per cell below which the motors stop.
  kBatteryRearm = 17,  ///< [V * 1000.0] Voltage per cell above which the robot may be armed.
  kCurrentScale = 18,  ///< [mA * 512.0] Motor current per ADC count.
  kCurrentZero = 19,  ///< [count * 1.0] ADC reading of a motor current of zero.
  kStallCurrent = 20,  ///< [A * 500.0] Current of a side's blocked motors at full PWM; 0 = unknown.
  kPwmFrequency = 21,  ///< [Hz * 1.0] PWM frequency: 122, 245, 490, 980, 3922 or 31373 (silent); another value is rounded down.
  kInput1 = 22,  ///< [ * 1.0] Protecting input 1 stops the motors: 0 never, 1 while it is low, 2 while it is high.
  kInput2 = 23,  ///< [ * 1.0] As input_1, for input 2.
  kGyroscope = 24,  ///< [ * 1.0] MPU-6050 at A4 and A5: 0 none, 1 its z axis points up, 2 down.
  kCurrentsAtA4 = 25,  ///< [ * 1.0] Motor currents: 0 at A6 and A7; 1 at A4 and A5, for an Uno. Then there is no gyroscope.
  kTiltLimit = 26,  ///< [V * 51.2] Tilted if the accelerometer's z is less than this above 1.65 V; 0 = never, negative: z down.
  kImpactLimit = 27,  ///< [V * 51.2] Impact if the accelerometer's output changes by more than this in 3 ms; 0 = never.
};
constexpr uint8_t kParameterCount = 28;

/// Range and default of a parameter, as wire values. The table is in flash: read it with ReadFlash().
struct ParameterRange {
  int16_t minimum, maximum, initial;
};
constexpr ParameterRange kParameterRanges[kParameterCount] FW_IN_FLASH = {
    {0, 31457, 3198},  // kp
    {0, 15729, 5715},  // ki
    {0, 12800, 2470},  // ks
    {0, 31457, 8976},  // kv
    {0, 10486, 673},  // ka
    {0, 20000, 800},  // acceleration
    {0, 20000, 1600},  // deceleration
    {1000, 20000, 8000},  // current_limit
    {40, 30000, 1200},  // counts_per_rev
    {10, 500, 62},  // wheel_radius
    {50, 2000, 245},  // track
    {0, 1, 0},  // left_motor_reversed
    {0, 1, 0},  // right_motor_reversed
    {0, 1, 0},  // left_encoder_reversed
    {0, 1, 0},  // right_encoder_reversed
    {1, 7, 2},  // battery_cells
    {2500, 4000, 3200},  // battery_stop
    {2600, 4200, 3500},  // battery_rearm
    {512, 30720, 25000},  // current_scale
    {0, 1023, 511},  // current_zero
    {0, 30000, 7500},  // stall_current
    {122, 31373, 122},  // pwm_frequency
    {0, 2, 0},  // input_1
    {0, 2, 0},  // input_2
    {0, 2, 0},  // gyroscope
    {0, 1, 0},  // currents_at_a4
    {-77, 77, 0},  // tilt_limit
    {0, 154, 0},  // impact_limit
};

}  // namespace fw
