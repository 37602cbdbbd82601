#pragma once

namespace thumper {

/// Faults of one side's wheels and motors; the defaults are fault-free.
struct SideFaults {
  double connected = 1.0;  // share of the side's motors with intact wires, 0...1
  double slip = 0.0;       // share of the wheels' travel lost on the floor, 0...1
  bool blocked = false;    // the wheels are jammed
  bool reversed = false;   // the motors' two wires are swapped
  bool shorted = false;    // the wires touch: kShort_Ohm between the bridge's outputs
  double friction = 1.0;   // of the side's wheels and gears, relative to a healthy side
};

/// Resistance of chafed wires that touch: contact and cable. At 7.4 V and PWM 100 already 29 A.
constexpr double kShort_Ohm = 0.1;

/// Faults of an encoder wire. The input has a pull-up, so a cut wire reads high.
enum class WireFault : int { kNone = 0, kCut = 1, kGrounded = 2, kStuck = 3 };

}  // namespace thumper
