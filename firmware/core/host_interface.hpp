#pragma once
#include <stdint.h>

#include "core/battery.hpp"
#include "core/config.hpp"
#include "core/drive.hpp"
#include "core/framing.hpp"
#include "core/messages.hpp"
#include "core/parameters.hpp"
#include "core/supervisor.hpp"

namespace fw {

/// The main loop's half of the firmware: host messages, supervisor, parameters, battery and the link
/// time-out. Pure: bytes, milliseconds and voltages come in; answers go to a sink, and command() says what
/// the motors may do.
class HostInterface {
 public:
  HostInterface(Board board, ResetCause reset_cause) : board_(board), reset_cause_(reset_cause) {}

  /// Take one received byte; answers go to `sink.Put(uint8_t)`. True when a good frame was handled.
  template <typename Sink>
  bool Receive(uint8_t byte, Sink& sink) {
    if (!decoder_.Push(byte)) return false;
    if (!Dispatch(sink)) ++refused_;
    return true;
  }

  /// Let `elapsed_ms` pass; without motion commands for 300 ms the motors stop.
  void Wait(uint8_t elapsed_ms) {
    if (!supervisor_.armed()) return;
    silence_ms_ = static_cast<uint16_t>(silence_ms_ + elapsed_ms);
    if (silence_ms_ >= kLinkTimeout_ms) Apply(Event::kLinkLost);
  }

  /// Take a battery reading; true at the moment the battery becomes low.
  bool UpdateBattery(uint16_t reading_mV) {
    const bool became_low = battery_.Update(reading_mV);
    if (became_low) Apply(Event::kBatteryLow);
    return became_low;
  }

  /// What the motors may do now.
  const DriveCommand& command() const { return command_; }
  WheelConfig config() const { return parameters_.Derive(); }
  const Supervisor& supervisor() const { return supervisor_; }
  uint16_t battery_mV() const { return battery_.filtered_mV(); }
  uint16_t rx_errors() const { return static_cast<uint16_t>(decoder_.errors() + refused_); }

 private:
  /// React to the frame in the decoder; false if its id or length is none of ours.
  template <typename Sink>
  bool Dispatch(Sink& sink) {
    switch (decoder_.id()) {
      case Identify::kId:  // of any length: it must work between all versions
        SendFrame(sink, decoder_.seq(), MakeIdentity());
        return true;
      case SetWheelSpeeds::kId: {
        if (decoder_.payload_size() != SetWheelSpeeds::kSize) return false;
        const auto message = SetWheelSpeeds::Unpack(decoder_.payload());
        if (supervisor_.state() == State::kClosedLoop) Drive(message.left, message.right);
        return true;
      }
      case SetMotorPwm::kId: {
        if (decoder_.payload_size() != SetMotorPwm::kSize) return false;
        const auto message = SetMotorPwm::Unpack(decoder_.payload());
        Apply(Event::kManual);
        if (supervisor_.state() == State::kManual) Drive(message.left, message.right);
        return true;
      }
      case CommandRequest::kId: {
        if (decoder_.payload_size() != CommandRequest::kSize) return false;
        const auto command = CommandRequest::Unpack(decoder_.payload()).command;
        const bool known = command <= Command::kClearFault;
        Acknowledge(sink, known ? Apply(static_cast<Event>(command)) : AckStatus::kUnknownCommand);
        return true;
      }
      case SetParameter::kId: {
        if (decoder_.payload_size() != SetParameter::kSize) return false;
        const auto message = SetParameter::Unpack(decoder_.payload());
        Acknowledge(sink, parameters_.Set(message.index, message.value));
        return true;
      }
      case GetParameter::kId: {
        if (decoder_.payload_size() != GetParameter::kSize) return false;
        const uint8_t index = GetParameter::Unpack(decoder_.payload()).index;
        if (index < kParameterCount) {
          SendFrame(sink, decoder_.seq(), ParameterValue{index, parameters_.Get(index)});
        } else {
          Acknowledge(sink, AckStatus::kUnknownParameter);
        }
        return true;
      }
      default:
        return false;
    }
  }

  template <typename Sink>
  void Acknowledge(Sink& sink, AckStatus status) {
    SendFrame(sink, decoder_.seq(), Ack{decoder_.id(), decoder_.seq(), status});
  }

  Identity MakeIdentity() const {
    return {kSchemaHash,     kVersionMajor, kVersionMinor, kVersionPatch,   board_,
            kControlRate_Hz, reset_cause_,  kCountsPerRev, kWheelRadius_mm, kTrack_mm};
  }

  /// A motion command that the present state acts on. Only these hold off the link time-out, so that a stream
  /// of wheel speeds cannot keep a dead gamepad's PWM alive.
  void Drive(int16_t left, int16_t right) {
    command_.left = left;
    command_.right = right;
    silence_ms_ = 0;
  }

  AckStatus Apply(Event event) {
    const AckStatus status = supervisor_.Handle(event, battery_.low());
    if (supervisor_.state() != command_.mode) {
      command_ = {supervisor_.state(), 0, 0};
      silence_ms_ = 0;
    }
    return status;
  }

  FrameDecoder<kMaxHostPayload> decoder_;
  Supervisor supervisor_;
  Parameters parameters_;
  Battery battery_;
  DriveCommand command_ = {State::kDisarmed, 0, 0};
  uint16_t silence_ms_ = 0;
  uint16_t refused_ = 0;
  Board board_;
  ResetCause reset_cause_;
};

}  // namespace fw
