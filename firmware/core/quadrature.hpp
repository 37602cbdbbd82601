#pragma once
#include <stdint.h>

namespace fw {

/// 4x quadrature decoder. Pure: the pin-change interrupt reads the port once and calls Step().
/// The count rises while A leads B and wraps at 2^16 by design; the control tick unwraps it.
class QuadratureDecoder {
 public:
  /// ab: bit 0 = A, bit 1 = B, as adjacent port bits come.
  /// Always inlined: an interrupt that calls saves every register.
  __attribute__((always_inline)) void Step(uint8_t ab) {
    const uint8_t changed = ab ^ ab_;
    if (changed == 0) return;  // a glitch that was over before the read
    if (changed == 0x3u) {
      ++lost_;  // both moved: direction unknown, so counted, never guessed
    } else if (((ab ^ (ab_ >> 1)) & 0x1u) != 0) {
      ++count_;  // new A differs from old B on every forward edge of 00 01 11 10
    } else {
      --count_;
    }
    ab_ = ab;
  }

  /// Take the pins' level as the start without counting.
  void Reset(uint8_t ab) { ab_ = ab; }

  uint16_t count() const { return count_; }  ///< [counts mod 2^16]
  uint16_t lost() const { return lost_; }    ///< [edges] since reset; wraps

 private:
  uint8_t ab_ = 0;
  uint16_t count_ = 0, lost_ = 0;
};

}  // namespace fw
