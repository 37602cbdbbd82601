#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "params.hpp"
#include "random.hpp"

namespace thumper {

/// A two-channel quadrature encoder: travel in, the next edge's time and level out. Pure.
///
/// The magnet's 16 edges per motor turn are not quite evenly spaced; each is off by its own fixed error.
class Encoder {
 public:
  Encoder(const EncoderParams& params, Random& random)
      : counts_per_rad_(params.counts_per_rev / (2.0 * M_PI)) {
    constexpr double kMostError = 0.4;  // so that the edges keep their order
    for (double& error : edge_error_)
      error = std::clamp(params.edge_error_counts * random.Normal(), -kMostError, kMostError);
  }

  /// The wheel turns evenly from one angle to another over `cycles`; both may be anything.
  void Plan(double from_rad, double to_rad, uint64_t start_cycle, uint64_t cycles) {
    from_ = from_rad * counts_per_rad_;
    slope_ = cycles > 0 ? (to_rad * counts_per_rad_ - from_) / static_cast<double>(cycles) : 0.0;
    start_cycle_ = start_cycle;
    end_cycle_ = start_cycle + cycles;
  }

  /// The cycle of the next edge within the plan, or 0 when there is none.
  uint64_t NextEdge() const {
    if (slope_ == 0.0) return 0;
    const double place = slope_ > 0.0 ? Edge(count_ + 1) : Edge(count_);
    const double wait = std::ceil((place - from_) / slope_);
    const double length = static_cast<double>(end_cycle_ - start_cycle_);
    if (wait > length) return 0;
    return start_cycle_ + static_cast<uint64_t>(std::max(wait, 0.0));
  }

  /// Pass the edge that `NextEdge` announced.
  void PassEdge() { count_ += slope_ > 0.0 ? 1 : -1; }

  int32_t count() const { return count_; }
  /// A leads B while the count rises: 00, 10, 11, 01 (A, B).
  bool a() const { return (count_ & 3) == 1 || (count_ & 3) == 2; }
  bool b() const { return (count_ & 3) >= 2; }

 private:
  /// The place [counts] where the count changes from n - 1 to n. Half a count off zero: no edge at the start.
  double Edge(int32_t n) const { return n - 0.5 + edge_error_[static_cast<uint32_t>(n) % 16]; }

  double counts_per_rad_;
  double edge_error_[16];
  double from_ = 0.0, slope_ = 0.0;
  uint64_t start_cycle_ = 0, end_cycle_ = 0;
  int32_t count_ = 0;
};

}  // namespace thumper
