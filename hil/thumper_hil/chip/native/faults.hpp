#pragma once

namespace thumper {

/// What can be wrong with one side's wheels and motors; all well by default.
struct SideFaults {
  double connected = 1.0;  // share of the side's motors whose wires are whole, 0...1
  double slip = 0.0;       // share of the wheels' travel that the floor does not get, 0...1
  bool blocked = false;    // the wheels are jammed
  bool reversed = false;   // the motors' two wires are exchanged
  bool shorted = false;    // the wires touch: kShort_Ohm between the bridge's outputs
};

/// Chafed wires that touch: contact and cable; at 7.4 V and PWM 100 already 29 A.
constexpr double kShort_Ohm = 0.1;

/// What can be wrong with an encoder's wire. Its input is pulled up: a cut one reads high.
enum class WireFault : int { kNone = 0, kCut = 1, kGrounded = 2, kStuck = 3 };

}  // namespace thumper
