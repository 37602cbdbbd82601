#pragma once
#include <stdint.h>

#include "core/messages.hpp"

namespace fw {

/// What the supervisor reacts to; the first four are the host's commands, in their wire order.
enum class Event : uint8_t { kDisarm, kArm, kEStop, kClearFault, kManual, kLinkLost, kBatteryLow };
constexpr uint8_t kEventCount = 7;
constexpr uint8_t kStateCount = 4;

/// The one state machine that decides whether the motors may turn.
class Supervisor {
 public:
  /// React to an event; the status answers the host where the event was its request.
  AckStatus Handle(Event event, bool battery_low) {
    if (battery_low && (event == Event::kArm || event == Event::kClearFault)) return AckStatus::kBatteryLow;
    const Reaction reaction = Look(state_, event);
    state_ = reaction.next;
    if (state_ != State::kFault) {
      fault_ = Fault::kNone;
    } else if (event == Event::kEStop) {
      fault_ = Fault::kEStop;
    } else if (event == Event::kBatteryLow) {
      fault_ = Fault::kLowBattery;
    } else if (event == Event::kLinkLost && fault_ == Fault::kNone) {
      fault_ = Fault::kLinkLost;
    }
    return reaction.status;
  }

  State state() const { return state_; }
  Fault fault() const { return fault_; }
  bool armed() const { return state_ == State::kClosedLoop || state_ == State::kManual; }

 private:
  struct Reaction {
    State next;
    AckStatus status;
  };

  static Reaction Look(State state, Event event) {
    constexpr Reaction kOff = {State::kDisarmed, AckStatus::kOk};
    constexpr Reaction kLoop = {State::kClosedLoop, AckStatus::kOk};
    constexpr Reaction kManu = {State::kManual, AckStatus::kOk};
    constexpr Reaction kFail = {State::kFault, AckStatus::kOk};
    constexpr Reaction kHeld = {State::kFault, AckStatus::kFaultLatched};
    static constexpr Reaction kTable[][kEventCount] = {
        // disarm, arm, e-stop, clear, manual PWM, link lost, battery low
        {kOff, kLoop, kFail, kOff, kOff, kOff, kFail},     // DISARMED
        {kOff, kLoop, kFail, kLoop, kManu, kFail, kFail},  // CLOSED_LOOP
        {kOff, kLoop, kFail, kManu, kManu, kFail, kFail},  // MANUAL
        {kFail, kHeld, kFail, kOff, kHeld, kFail, kFail},  // FAULT
    };
    static_assert(sizeof(kTable) / sizeof(kTable[0]) == kStateCount, "a row for every state");
    return kTable[static_cast<uint8_t>(state)][static_cast<uint8_t>(event)];
  }

  State state_ = State::kDisarmed;
  Fault fault_ = Fault::kNone;
};

}  // namespace fw
