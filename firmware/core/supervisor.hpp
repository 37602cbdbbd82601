#pragma once
#include <stdint.h>

#include "core/messages.hpp"

namespace fw {

/// Inputs of the supervisor: the host's first four commands in wire order, manual PWM, and two kinds of
/// faults: those that matter only while armed and those that always matter.
enum class Event : uint8_t { kDisarm, kArm, kEStop, kClearFault, kManual, kFaultArmed, kFaultAlways, kEnd };
constexpr uint8_t kEventCount = static_cast<uint8_t>(Event::kEnd);

/// Whether event and command have the same number.
constexpr bool IsEventOf(Event event, Command command) {
  return static_cast<uint8_t>(event) == static_cast<uint8_t>(command);
}
static_assert(IsEventOf(Event::kDisarm, Command::kDisarm) && IsEventOf(Event::kArm, Command::kArm) &&
                  IsEventOf(Event::kEStop, Command::kEStop) &&
                  IsEventOf(Event::kClearFault, Command::kClearFault),
              "the host's first commands must be events, in the same order");

/// The event of a fault. The compiler reports a fault without a case (-Wswitch).
constexpr Event EventOf(Fault fault) {
  switch (fault) {
    case Fault::kNone:
    case Fault::kLinkLost:
    case Fault::kStallLeft:
    case Fault::kStallRight:
    case Fault::kReversedLeft:
    case Fault::kReversedRight:
    case Fault::kLostEdges:
    case Fault::kOverCurrent:
    case Fault::kTilted:
    case Fault::kImpact:
      return Event::kFaultArmed;
    case Fault::kEStop:
      return Event::kEStop;
    case Fault::kLowBattery:
    case Fault::kWatchdog:
    case Fault::kBadParameters:
    case Fault::kAdcStopped:
    case Fault::kHighBattery:
    case Fault::kInput1:
    case Fault::kInput2:
      return Event::kFaultAlways;
  }
  return Event::kFaultAlways;
}

/// A cell of the transition table. A missing cell is 0, kUnhandled, and fails the build.
enum class Reaction : uint8_t { kUnhandled, kDisarmed, kClosedLoop, kManual, kFault, kRefused };

struct Transitions {
  Reaction cells[kStateCount][kEventCount];

  constexpr Reaction at(State state, Event event) const {
    return cells[static_cast<uint8_t>(state)][static_cast<uint8_t>(event)];
  }
};

constexpr Transitions MakeTransitions() {
  constexpr Reaction kOff = Reaction::kDisarmed, kLoop = Reaction::kClosedLoop, kManu = Reaction::kManual,
                     kFail = Reaction::kFault, kHeld = Reaction::kRefused;
  return {{
      // disarm, arm, e-stop, clear, manual, fault while armed, fault always
      {kOff, kLoop, kFail, kOff, kOff, kOff, kFail},     // DISARMED
      {kOff, kLoop, kFail, kLoop, kManu, kFail, kFail},  // CLOSED_LOOP
      {kOff, kLoop, kFail, kManu, kManu, kFail, kFail},  // MANUAL
      {kFail, kHeld, kFail, kOff, kHeld, kFail, kFail},  // FAULT
  }};
}

/// The state after a reaction. A refusal keeps FAULT.
constexpr State StateAfter(Reaction reaction) {
  return reaction == Reaction::kRefused ? State::kFault
                                        : static_cast<State>(static_cast<uint8_t>(reaction) - 1);
}
static_assert(StateAfter(Reaction::kDisarmed) == State::kDisarmed &&
                  StateAfter(Reaction::kClosedLoop) == State::kClosedLoop &&
                  StateAfter(Reaction::kManual) == State::kManual &&
                  StateAfter(Reaction::kFault) == State::kFault,
              "reactions and states are in the same order");

/// Every state handles every event.
constexpr bool Complete(const Transitions& table) {
  for (uint8_t s = 0; s < kStateCount; ++s) {
    for (uint8_t e = 0; e < kEventCount; ++e) {
      if (table.cells[s][e] == Reaction::kUnhandled || table.cells[s][e] > Reaction::kRefused) return false;
      // Only a latched fault may refuse.
      if (table.cells[s][e] == Reaction::kRefused && static_cast<State>(s) != State::kFault) return false;
    }
  }
  return true;
}

/// Every state is reachable from DISARMED, and DISARMED from every state.
constexpr bool Connected(const Transitions& table) {
  bool from_start[kStateCount] = {true}, to_start[kStateCount] = {true};
  for (uint8_t round = 0; round < kStateCount; ++round) {
    for (uint8_t s = 0; s < kStateCount; ++s) {
      for (uint8_t e = 0; e < kEventCount; ++e) {
        const uint8_t next = static_cast<uint8_t>(StateAfter(table.cells[s][e]));
        if (from_start[s]) from_start[next] = true;
        if (to_start[next]) to_start[s] = true;
      }
    }
  }
  for (uint8_t s = 0; s < kStateCount; ++s) {
    if (!from_start[s] || !to_start[s]) return false;
  }
  return true;
}

/// In every state an E-stop and a fault stop the motors. Only CLEAR_FAULT leaves FAULT.
constexpr bool Safe(const Transitions& table) {
  for (uint8_t s = 0; s < kStateCount; ++s) {
    const State state = static_cast<State>(s);
    if (table.at(state, Event::kEStop) != Reaction::kFault) return false;
    if (table.at(state, Event::kFaultAlways) != Reaction::kFault) return false;
    if (state != State::kDisarmed && table.at(state, Event::kFaultArmed) != Reaction::kFault) return false;
  }
  for (uint8_t e = 0; e < kEventCount; ++e) {
    const bool leaves = StateAfter(table.at(State::kFault, static_cast<Event>(e))) != State::kFault;
    if (leaves != (static_cast<Event>(e) == Event::kClearFault)) return false;
  }
  return true;
}

static_assert(Complete(MakeTransitions()), "every state needs a reaction to every event");
static_assert(Connected(MakeTransitions()), "every state must be reachable and must lead back to DISARMED");
static_assert(Safe(MakeTransitions()),
              "every fault must stop the motors, and only CLEAR_FAULT may unlatch it");

/// Whether a fault replaces a latched one. E_STOP is an operator's decision: it replaces every fault, and no
/// fault replaces it. LOW_BATTERY replaces all others, because the operator must see it.
constexpr bool Outranks(Fault fault, Fault latched) {
  return latched == Fault::kNone || fault == Fault::kEStop ||
         (fault == Fault::kLowBattery && latched != Fault::kEStop);
}

/// The state machine that alone decides whether the motors may run.
class Supervisor {
 public:
  /// Handle an event from the host and return the answer. ready: unless OK, the answer to ARM and
  /// CLEAR_FAULT.
  AckStatus Handle(Event event, AckStatus ready) {
    if (ready != AckStatus::kOk && (event == Event::kArm || event == Event::kClearFault)) return ready;
    return Take(event, Fault::kEStop);
  }

  /// Stop for a fault. A latched fault stays unless the new one outranks it.
  void Trip(Fault fault) { Take(EventOf(fault), fault); }

  /// Latch the fault again that was latched before a restart.
  void Relatch(Fault fault) {
    if (fault != Fault::kNone) Take(Event::kFaultAlways, fault);
  }

  State state() const { return state_; }
  Fault fault() const { return fault_; }
  bool armed() const { return state_ == State::kClosedLoop || state_ == State::kManual; }

 private:
  AckStatus Take(Event event, Fault fault) {
    static constexpr Transitions kTable = MakeTransitions();
    const Reaction reaction = kTable.at(state_, event);
    state_ = StateAfter(reaction);
    if (state_ != State::kFault) {
      fault_ = Fault::kNone;
    } else if (event == Event::kEStop || event == Event::kFaultAlways || event == Event::kFaultArmed) {
      if (Outranks(fault, fault_)) fault_ = fault;
    }
    return reaction == Reaction::kRefused ? AckStatus::kFaultLatched : AckStatus::kOk;
  }

  State state_ = State::kDisarmed;
  Fault fault_ = Fault::kNone;
};

}  // namespace fw
