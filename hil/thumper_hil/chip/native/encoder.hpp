#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "params.hpp"
#include "random.hpp"

namespace thumper {

/// Two-channel quadrature encoder: travel in, time and level of the next edge out. Pure.
///
/// The magnet's 16 edges per motor revolution are not evenly spaced: each has its own fixed error.
class Encoder {
 public:
  Encoder(const EncoderParams& params, Random& random)
      : counts_per_rad_(params.counts_per_rev / (2.0 * M_PI)) {
    constexpr double kMostError = 0.4;  // keeps the edges in order
    for (double& error : edge_error_)
      error = std::clamp(params.edge_error_counts * random.Normal(), -kMostError, kMostError);
  }

  /// Plan a constant rotation from one angle to another over `cycles`. Any angles are valid.
  void Plan(double from_rad, double to_rad, uint64_t start_cycle, uint64_t cycles) {
    from_ = from_rad * counts_per_rad_;
    slope_ = cycles > 0 ? (to_rad * counts_per_rad_ - from_) / static_cast<double>(cycles) : 0.0;
    start_cycle_ = start_cycle;
    end_cycle_ = start_cycle + cycles;
  }

  /// Return the cycle of the next edge within the plan, or 0 if there is none.
  uint64_t NextEdge() const {
    if (slope_ == 0.0) return 0;
    const double position = slope_ > 0.0 ? Edge(count_ + 1) : Edge(count_);
    const double wait = std::ceil((position - from_) / slope_);
    const double length = static_cast<double>(end_cycle_ - start_cycle_);
    if (wait > length) return 0;
    return start_cycle_ + static_cast<uint64_t>(std::max(wait, 0.0));
  }

  /// Pass the edge that `NextEdge` returned.
  void PassEdge() { count_ += slope_ > 0.0 ? 1 : -1; }

  int32_t count() const { return count_; }
  /// A leads B while the count rises: 00, 10, 11, 01 (A, B).
  bool a() const { return (count_ & 3) == 1 || (count_ & 3) == 2; }
  bool b() const { return (count_ & 3) >= 2; }

 private:
  /// Position [counts] where the count changes from n - 1 to n. The half count avoids an edge at the start.
  double Edge(int32_t n) const { return n - 0.5 + edge_error_[static_cast<uint32_t>(n) % 16]; }

  double counts_per_rad_;
  double edge_error_[16];
  double from_ = 0.0, slope_ = 0.0;
  uint64_t start_cycle_ = 0, end_cycle_ = 0;
  int32_t count_ = 0;
};

}  // namespace thumper
