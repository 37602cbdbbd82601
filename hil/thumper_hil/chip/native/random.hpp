#pragma once
#include <cmath>
#include <cstdint>

namespace thumper {

/// Random numbers that depend only on the seed, on every machine: xoshiro256** (Blackman & Vigna 2018),
/// seeded by splitmix64. The standard library's distributions differ between implementations.
class Random {
 public:
  explicit Random(uint64_t seed) {
    for (uint64_t& word : state_) {
      seed += 0x9E3779B97F4A7C15u;
      uint64_t z = seed;
      z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
      z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
      word = z ^ (z >> 31);
    }
  }

  /// Uniform in [0, 1).
  double Uniform() { return static_cast<double>(Next() >> 11) * 0x1.0p-53; }

  /// Return a normal variate: mean 0, standard deviation 1, within +/-6. Sum of twelve uniforms, without
  /// libm.
  double Normal() {
    double sum = -6.0;
    for (int i = 0; i < 12; ++i) sum += Uniform();
    return sum;
  }

 private:
  static uint64_t Rotate(uint64_t x, int k) { return (x << k) | (x >> (64 - k)); }

  uint64_t Next() {
    const uint64_t result = Rotate(state_[1] * 5, 7) * 9;
    const uint64_t t = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= t;
    state_[3] = Rotate(state_[3], 45);
    return result;
  }

  uint64_t state_[4];
};

/// Ornstein-Uhlenbeck process: noise with a given standard deviation and correlation time.
class CorrelatedNoise {
 public:
  CorrelatedNoise(double std, double time_s) : std_(std), time_s_(time_s) {}

  double Step(Random& random, double dt_s) {
    const double keep = std::exp(-dt_s / time_s_);
    value_ = keep * value_ + std_ * std::sqrt(1.0 - keep * keep) * random.Normal();
    return value_;
  }

 private:
  double std_, time_s_, value_ = 0.0;
};

}  // namespace thumper
