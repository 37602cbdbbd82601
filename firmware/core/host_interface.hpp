#pragma once
#include <stddef.h>
#include <stdint.h>

#include "core/acceleration.hpp"
#include "core/battery.hpp"
#include "core/config.hpp"
#include "core/drive.hpp"
#include "core/framing.hpp"
#include "core/messages.hpp"
#include "core/monitor.hpp"
#include "core/parameters.hpp"
#include "core/store.hpp"
#include "core/supervisor.hpp"

namespace fw {

/// The firmware's work outside the control tick: host messages, supervisor and monitors, parameters, battery
/// and link time-out. Pure: its inputs are bytes, milliseconds, samples and voltages. It writes answers to a
/// sink, and command() returns the motors' command.
class HostInterface {
 public:
  HostInterface(Board board, ResetCause reset_cause) : board_(board), reset_cause_(reset_cause) {}

  /// Call once, before everything else. Loads the saved parameters and latches any fault from before the
  /// restart or from loading. latched: the fault that was latched before the restart. LINK_LOST is not
  /// latched again, because the host is back.
  template <typename Memory>
  void Start(Memory& memory, Fault latched) {
    if (latched != Fault::kLinkLost) supervisor_.Relatch(latched);
    const auto outcome = store_.Load(memory, &parameters_);
    if (outcome == ParameterStore::Outcome::kLoaded) source_ = ParameterSource::kSaved;
    if (outcome == ParameterStore::Outcome::kUnreadable) supervisor_.Trip(Fault::kBadParameters);
    if (reset_cause_ == ResetCause::kWatchdog) supervisor_.Trip(Fault::kWatchdog);
    SyncMode();
  }

  /// Process one received byte and write answers to `sink.Put(uint8_t)`. Return true if it completed a valid
  /// frame.
  template <typename Sink>
  bool Receive(uint8_t byte, Sink& sink) {
    if (!decoder_.Push(byte)) return false;
    if (!Dispatch(sink)) ++refused_;
    return true;
  }

  /// Advance the time. Stops the motors after 300 ms without motion commands.
  void AdvanceTime(uint8_t elapsed_ms) {
    if (!supervisor_.armed()) return;
    silence_ms_ = static_cast<uint16_t>(silence_ms_ + elapsed_ms);
    if (silence_ms_ >= kLinkTimeout_ms) Trip(Fault::kLinkLost);
  }

  /// Continue a pending SAVE or LOAD without blocking.
  template <typename Memory, typename Sink>
  void StepStore(Memory& memory, Sink& sink) {
    if (store_.Step(memory)) {
      const bool saved = store_.Verify(memory);
      if (saved) source_ = ParameterSource::kSaved;
      // The host may have sent another request meanwhile. Then pending_seq_ belongs to that request, and the
      // values just saved may be outdated.
      if (pending_ == Command::kDisarm) AnswerPending(sink, saved ? AckStatus::kOk : AckStatus::kNotSaved);
    }
    if (pending_ == Command::kDisarm || store_.saving()) return;
    const Command todo = pending_;
    pending_ = Command::kDisarm;
    if (todo == Command::kSave) {
      store_.Begin(parameters_);
      return;
    }
    AnswerPending(sink, Load(memory));
  }

  /// Return true once after each change of the parameters, and on the first call.
  bool TakeChange() {
    const bool changed = changed_;
    changed_ = false;
    // Its last reading may be old: the limits change only while the motors are off.
    if (changed && !supervisor_.armed()) acceleration_monitor_ = AccelerationMonitor();
    return changed;
  }

  /// Destination of the control tick's samples, which Watch() then checks.
  Samples* samples() { return &samples_; }

  void Watch() {
    const bool held_left = HeldByFloor(samples_.left.wheel, samples_.right.wheel, left_mA_);
    const bool held_right = HeldByFloor(samples_.right.wheel, samples_.left.wheel, right_mA_);
    Watch(left_monitor_, samples_.left, held_left, Fault::kStallLeft, Fault::kReversedLeft);
    Watch(right_monitor_, samples_.right, held_right, Fault::kStallRight, Fault::kReversedRight);
    if (edge_monitor_.Step(samples_.lost_edges)) Trip(Fault::kLostEdges);
  }

  /// Add a battery reading. Return true at the moment the battery becomes low.
  bool UpdateBattery(uint16_t reading_mV) {
    const Fault fault = battery_.Update(reading_mV, parameters_.battery_limits());
    if (fault != Fault::kNone) Trip(fault);
    return fault == Fault::kLowBattery;
  }

  /// Call while there are no analogue readings. Stops the motors and forgets the last readings, because
  /// neither an empty battery nor a blocked motor can be detected.
  void LoseAnalogReadings() {
    Trip(Fault::kAdcStopped);
    battery_ = Battery();
    left_mA_ = 0;
    right_mA_ = 0;
  }

  /// Take the levels of the protecting inputs: bit 0 is input 1, bit 1 is input 2. Call about once per
  /// millisecond. An active input stops the motors, and nothing arms or clears while it stays active.
  void UpdateInputs(uint8_t levels) {
    const bool first = input_1_.Step((levels & 1) != 0, parameters_.Get(Parameter::kInput1));
    const bool second = input_2_.Step((levels & 2) != 0, parameters_.Get(Parameter::kInput2));
    if (first) Trip(Fault::kInput1);
    if (second) Trip(Fault::kInput2);
    input_active_ = first || second;
  }

  /// Take the accelerometer's readings of x, y and z (AccelerationMonitor).
  void UpdateAcceleration(const uint8_t (&reading)[3]) {
    const Fault fault = acceleration_monitor_.Step(reading, parameters_.Get(Parameter::kTiltLimit),
                                                   parameters_.Get(Parameter::kImpactLimit));
    if (fault != Fault::kNone) Trip(fault);
  }

  /// Count control ticks whose telemetry was not sent.
  void CountDropped(uint8_t ticks) { tx_dropped_ = static_cast<uint16_t>(tx_dropped_ + ticks); }

  /// Process the motor currents of the last 96 ms.
  void UpdateCurrents(int16_t left_mA, int16_t right_mA) {
    const int16_t limit_mA = parameters_.Get(Parameter::kCurrentLimit);
    if (current_monitor_.Step(left_mA, right_mA, limit_mA)) Trip(Fault::kOverCurrent);
    left_mA_ = left_mA;
    right_mA_ = right_mA;
  }

  /// heading, gyroscope: of the gyroscope, at the samples' tick.
  template <typename Sink>
  void SendTelemetry(Sink& sink, uint16_t heading, GyroscopeState gyroscope) {
    Frame<Telemetry> frame;
    frame.id = Telemetry::kId;
    frame.seq = telemetry_seq_++;
    auto& message = frame.message;
    constexpr size_t kSamples = offsetof(Telemetry, battery_mV);
    static_assert(offsetof(Samples, lost_edges) + sizeof(samples_.lost_edges) == kSamples &&
                      offsetof(Samples, right) == offsetof(Telemetry, right_count),
                  "telemetry must begin with the samples");
    __builtin_memcpy(&message, &samples_, kSamples);
    message.battery_mV = battery_.filtered_mV();
    message.left_current_mA = left_mA_;
    message.right_current_mA = right_mA_;
    message.state = supervisor_.state();
    message.fault = supervisor_.fault();
    message.warnings = static_cast<uint8_t>(battery_.warning());
    message.rx_frames = decoder_.frames();
    message.rx_errors = rx_errors();
    message.tx_dropped = tx_dropped_;
    message.heading = heading;
    message.gyroscope = gyroscope;
    SendFrame(sink, frame);
  }

  /// The motors' current command.
  const DriveCommand& command() const { return command_; }
  const Parameters& parameters() const { return parameters_; }
  const Supervisor& supervisor() const { return supervisor_; }
  uint16_t battery_mV() const { return battery_.filtered_mV(); }
  uint16_t rx_errors() const { return static_cast<uint16_t>(decoder_.errors() + refused_); }
  /// True while the motors are off and the wheels were stationary in the last interval.
  bool quiet() const { return !supervisor_.armed() && stationary(); }
  /// The same, but the robot may be armed.
  __attribute__((noinline)) bool stationary() const {
    const WheelSample &left = samples_.left.wheel, &right = samples_.right.wheel;
    return (left.speed_mrad_s | left.pwm | right.speed_mrad_s | right.pwm) == 0;
  }

 private:
  /// Handle the frame in the decoder. Return false if its id or length is unknown.
  template <typename Sink>
  bool Dispatch(Sink& sink) {
    const uint8_t id = decoder_.id();
    // `identify` may have any length, because it must work between all versions.
    if (id != Identify::kId && decoder_.payload_size() != HostPayloadSize(id)) return false;
    switch (id) {
      case Identify::kId:
        SendFrame(sink, decoder_.seq(), MakeIdentity());
        return true;
      case SetWheelSpeeds::kId: {
        const auto& message = Payload<SetWheelSpeeds>();
        if (supervisor_.state() == State::kClosedLoop) Drive(message.left, message.right, kMaxSpeed_mrad_s);
        return true;
      }
      case SetMotorPwm::kId: {
        const auto& message = Payload<SetMotorPwm>();
        Apply(Event::kManual);
        if (supervisor_.state() == State::kManual) Drive(message.left, message.right, kMaxPwm);
        return true;
      }
      case CommandRequest::kId:
        HandleCommand(Payload<CommandRequest>().command, sink);
        return true;
      case SetParameter::kId: {
        const auto& message = Payload<SetParameter>();
        changed_ = true;
        Acknowledge(sink, SetOne(message.index, message.value));
        return true;
      }
      case GetParameter::kId: {
        const uint8_t index = Payload<GetParameter>().index;
        if (index < kParameterCount) {
          SendFrame(sink, decoder_.seq(), ParameterValue{index, parameters_.Get(index)});
        } else {
          Acknowledge(sink, AckStatus::kUnknownParameter);
        }
        return true;
      }
      default:  // unreachable while every message of the schema has a case
        return false;
    }
  }

  AckStatus SetOne(uint8_t index, int16_t value) {
    if (supervisor_.armed() && index >= kFirstRobotParameter) return AckStatus::kArmed;
    const bool of_accelerometer =
        IsIndex(index, Parameter::kTiltLimit) || IsIndex(index, Parameter::kImpactLimit);
    if (of_accelerometer && value != 0 && board_ != Board::kTrex) return AckStatus::kNoAccelerometer;
    const bool in_use =
        (IsIndex(index, Parameter::kGyroscope) && parameters_.IsSet(Parameter::kCurrentsAtA4)) ||
        (IsIndex(index, Parameter::kCurrentsAtA4) && parameters_.IsSet(Parameter::kGyroscope));
    return in_use && value != 0 ? AckStatus::kPinsInUse : parameters_.Set(index, value);
  }

  static bool IsIndex(uint8_t index, Parameter parameter) { return index == static_cast<uint8_t>(parameter); }

  template <typename Sink>
  void HandleCommand(Command command, Sink& sink) {
    AckStatus status = AckStatus::kUnknownCommand;
    if (command <= Command::kClearFault) {
      status = Apply(static_cast<Event>(command));
    } else if (command == Command::kRestoreDefaults) {
      status = supervisor_.armed() ? AckStatus::kArmed : AckStatus::kOk;
      if (status == AckStatus::kOk) RestoreDefaults();
    } else if (command == Command::kSave && battery_.status() != AckStatus::kOk) {
      status = battery_.status();  // the supply may fail during the write
    } else if (command <= Command::kLoad) {
      pending_seq_ = decoder_.seq();  // StepStore() answers the newest request when done
      pending_ = command;
      return;
    }
    Acknowledge(sink, status);
  }

  void RestoreDefaults() {
    parameters_.Restore();
    source_ = ParameterSource::kDefaults;
    changed_ = true;
  }

  /// Load the saved parameters. Refused while armed, because a whole set may change the control abruptly, and
  /// if the EEPROM content is invalid.
  template <typename Memory>
  AckStatus Load(Memory& memory) {
    if (supervisor_.armed()) return AckStatus::kArmed;
    switch (store_.Load(memory, &parameters_)) {
      case ParameterStore::Outcome::kUnreadable:
        return AckStatus::kBadParameters;
      case ParameterStore::Outcome::kEmpty:
        RestoreDefaults();
        break;
      case ParameterStore::Outcome::kLoaded:
        source_ = ParameterSource::kSaved;
        changed_ = true;
        break;
    }
    return AckStatus::kOk;
  }

  /// Answer a SAVE or LOAD.
  template <typename Sink>
  void AnswerPending(Sink& sink, AckStatus status) {
    SendFrame(sink, pending_seq_, Ack{CommandRequest::kId, pending_seq_, status});
  }

  template <typename Message>
  const Message& Payload() const {
    return *reinterpret_cast<const Message*>(decoder_.payload());  // packed: any address is valid
  }

  template <typename Sink>
  void Acknowledge(Sink& sink, AckStatus status) {
    SendFrame(sink, decoder_.seq(), Ack{decoder_.id(), decoder_.seq(), status});
  }

  Identity MakeIdentity() const {
    uint8_t reversed = 0;
    for (uint8_t i = 0; i < 4; ++i) {
      if (parameters_.Get(static_cast<uint8_t>(Parameter::kLeftMotorReversed) + i) != 0) reversed |= 1 << i;
    }
    const auto get = [this](Parameter parameter) {
      return static_cast<uint16_t>(parameters_.Get(parameter));
    };
    return {kSchemaHash,
            kVersionMajor,
            kVersionMinor,
            kVersionPatch,
            board_,
            kControlRate_Hz,
            reset_cause_,
            get(Parameter::kCountsPerRev),
            get(Parameter::kWheelRadius),
            get(Parameter::kTrack),
            reversed,
            static_cast<uint8_t>(get(Parameter::kBatteryCells)),
            get(Parameter::kBatteryStop),
            get(Parameter::kBatteryRearm),
            get(Parameter::kCurrentScale),
            get(Parameter::kCurrentZero),
            get(Parameter::kPwmFrequency),
            source_};
  }

  /// True if a side turns slowly against a faster other one, and its motor draws at least 75 % of what it
  /// draws when it is blocked at this PWM. Then the tyres' scrub may hold it until the integral is large
  /// enough. A wheel that turns and does not count draws less. The over-current limit ends a real block.
  __attribute__((noinline)) bool HeldByFloor(const WheelSample& wheel, const WheelSample& other,
                                             int16_t current_mA) const {
    const int16_t setpoint = wheel.setpoint_mrad_s;
    if ((setpoint ^ other.setpoint_mrad_s) >= 0 || Magnitude(setpoint) > kSlow_mrad_s) return false;
    const int16_t stall_2mA = parameters_.Get(Parameter::kStallCurrent);
    return stall_2mA != 0 && Magnitude(other.setpoint_mrad_s) > 2 * Magnitude(setpoint) &&
           Magnitude(current_mA) * (kMaxPwm * 4 / 3) >= int32_t(2) * stall_2mA * Magnitude(wheel.pwm);
  }

  void Watch(WheelMonitor& monitor, const SideSample& sample, bool held, Fault stall, Fault reversed) {
    // While the controller brakes, the body may carry the wheel on against the output: no wiring fault. But
    // then the controller holds the speed. With a reversed encoder it accelerates the wheel instead.
    const WheelSample& wheel = sample.wheel;
    const bool brakes = wheel.setpoint_mrad_s != 0 && (wheel.setpoint_mrad_s ^ wheel.pwm) < 0 &&
                        Magnitude(Difference(wheel.speed_mrad_s, wheel.setpoint_mrad_s)) < kBraked_mrad_s;
    const int16_t push = brakes || held ? int16_t(0) : wheel.pwm;
    const auto verdict = monitor.Step(static_cast<uint16_t>(sample.count), push);
    if (verdict == WheelMonitor::Verdict::kStall) Trip(stall);
    if (verdict == WheelMonitor::Verdict::kReversed) Trip(reversed);
  }

  /// Execute a motion command that applies in the current state. Only these reset the link time-out, so a
  /// stream of wheel speeds cannot keep the last PWM of a dead gamepad alive.
  void Drive(int16_t left, int16_t right, int16_t limit) {
    command_.left = static_cast<int16_t>(Limit(left, limit));
    command_.right = static_cast<int16_t>(Limit(right, limit));
    silence_ms_ = 0;
  }

  AckStatus Apply(Event event) {
    const AckStatus battery = battery_.status();
    const AckStatus ready = battery == AckStatus::kOk && input_active_ ? AckStatus::kInputActive : battery;
    const AckStatus status = supervisor_.Handle(event, ready);
    SyncMode();
    return status;
  }

  void Trip(Fault fault) {
    supervisor_.Trip(fault);
    SyncMode();
  }

  /// Start every new state from rest: clear set-point and PWM.
  void SyncMode() {
    if (supervisor_.state() == command_.mode) return;
    command_ = {supervisor_.state(), 0, 0};
    silence_ms_ = 0;
  }

  FrameDecoder<kMaxHostPayload> decoder_;
  Supervisor supervisor_;
  Parameters parameters_;
  ParameterStore store_;
  Battery battery_;
  WheelMonitor left_monitor_, right_monitor_;
  EdgeMonitor edge_monitor_;
  CurrentMonitor current_monitor_;
  InputMonitor input_1_, input_2_;
  AccelerationMonitor acceleration_monitor_;
  Samples samples_ = {};
  int16_t left_mA_ = 0, right_mA_ = 0;
  DriveCommand command_ = {State::kDisarmed, 0, 0};
  uint16_t silence_ms_ = 0;
  uint16_t refused_ = 0;
  uint16_t tx_dropped_ = 0;
  Command pending_ = Command::kDisarm;  // SAVE or LOAD waiting for StepStore(); DISARM: none
  uint8_t pending_seq_ = 0, telemetry_seq_ = 0;
  bool changed_ = true, input_active_ = false;
  Board board_;
  ResetCause reset_cause_;
  ParameterSource source_ = ParameterSource::kDefaults;
};

}  // namespace fw
