#pragma once
#include <stdint.h>

namespace fw {

/// 4x quadrature decoder. Pure: the pin-change interrupt reads the port once and calls Step().
/// The count rises while A leads B. It wraps at 2^16 by design; the control tick unwraps it.
/// kPins: the port's two encoder pins, adjacent; A is the lower one.
/// The chip runs Step() in assembly (board/encoder_edge.hpp); a test compares both on random walks.
template <uint8_t kPins>
class QuadratureDecoder {
 public:
  static constexpr uint8_t kA = kPins & -kPins, kAB = kPins;
  static_assert(kPins == (kA | kA << 1), "A and B must be adjacent on their port");

  /// port: the whole port.
  void Step(uint8_t port) {
    const uint8_t ab = port & kPins;
    const uint8_t old = ab_;
    const uint8_t changed = ab ^ old;
    if (changed == 0) return;  // a glitch that ended before the read
    ab_ = ab;
    if (changed == kPins) {
      if (++lost_low_ == 0) ++lost_high_;  // both pins changed: direction unknown, so count a lost edge
      return;
    }
    // New A differs from old B on every forward edge of 00 01 11 10.
    const uint8_t old_b = old >> 1;
    const uint8_t direction = ab ^ old_b;
    if ((direction & kA) != 0) {
      if (++low_ == 0) ++high_;
    } else {
      if (low_-- == 0) --high_;
    }
  }

  /// Set the start level from the port without counting.
  void Reset(uint8_t port) { ab_ = port & kPins; }

  uint16_t count() const { return static_cast<uint16_t>(high_ << 8 | low_); }           ///< [counts mod 2^16]
  uint16_t lost() const { return static_cast<uint16_t>(lost_high_ << 8 | lost_low_); }  ///< [edges mod 2^16]

  /// Separate bytes, because the interrupt rarely changes the upper ones.
  uint8_t ab_ = 0, low_ = 0, high_ = 0, lost_low_ = 0, lost_high_ = 0;
};

}  // namespace fw
