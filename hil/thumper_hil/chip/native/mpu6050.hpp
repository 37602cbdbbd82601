#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>

#include "random.hpp"

namespace thumper {

/// MPU-6050 as its I2C master sees it: registers, bytes and the yaw rate that it measures.
///
/// From MPU-6000/6050 Register Map and Descriptions (RM-MPU-6000A-00, rev. 4.2) and Product Specification
/// (PS-MPU-6000A-00, rev. 3.4): reset values, sleep, ranges, low-pass filters, noise density. Only the axes'
/// yaw rate is modelled; the accelerometer and the other axes read zero.
class Mpu6050 {
 public:
  explicit Mpu6050(uint64_t seed) : random_(seed ^ 0x6050) { PowerOn(); }

  /// identity: what WHO_AM_I reads; 0x68, unless another device has this address.
  void Fit(double bias_deg_s, bool upside_down, uint8_t identity) {
    fitted_ = powered_ = true;
    identity_ = registers_[kWhoAmI] = identity;
    bias_deg_s_ = bias_deg_s;
    upside_down_ = upside_down;
  }

  /// Without power the device does not answer. With it, all registers have their reset values: it sleeps.
  void SetPower(bool on) {
    powered_ = on;
    PowerOn();
  }

  /// Hang in the middle of a byte with the data line low, for this many clock pulses; negative: for ever.
  void HoldData(int pulses) { held_pulses_ = pulses; }
  /// Stretch the clock without end.
  void HoldClock(bool held) { clock_held_ = held; }
  bool holds_data() const { return held_pulses_ != 0; }
  bool holds_clock() const { return clock_held_; }
  void ClockPulse() {
    if (held_pulses_ > 0) --held_pulses_;
  }

  void SetRate(double yaw_rad_s) { yaw_rad_s_ = yaw_rad_s; }
  void SetFrozen(bool frozen) { frozen_ = frozen; }

  /// A start condition on an idle bus, at this time. Until then the device has updated the readable copy of
  /// its measurements (register map, 4.19).
  void Start(double time_s) {
    time_s_ = time_s;
    Latch();
  }

  /// The address byte. Return true if the device acknowledges.
  bool Select(uint8_t byte) {
    constexpr uint8_t kAddress = 0x68;  // AD0 low
    const bool mine = fitted_ && powered_ && byte >> 1 == kAddress;
    expects_register_ = mine && (byte & 1) == 0;
    return mine;
  }

  /// A byte from the master: the register's number, then values. Always acknowledged.
  void Write(uint8_t byte) {
    if (expects_register_) {
      pointer_ = byte;
      expects_register_ = false;
      return;
    }
    if (pointer_ == kPower && (byte & kReset) != 0) {
      PowerOn();
    } else if (Writable(pointer_)) {
      const bool wakes = pointer_ == kPower && (registers_[kPower] & kSleep) != 0 && (byte & kSleep) == 0;
      if (wakes) measures_from_s_ = time_s_ + kStartUp_s;
      registers_[pointer_] = byte;
    }
    ++pointer_;
  }

  uint8_t Read() { return registers_[pointer_++ & 0x7F]; }

 private:
  static constexpr uint8_t kConfig = 0x1A, kGyroConfig = 0x1B, kGyroZ = 0x47, kPower = 0x6B, kWhoAmI = 0x75;
  static constexpr double kStartUp_s = 0.03;
  static constexpr uint8_t kReset = 0x80, kSleep = 0x40;

  static bool Writable(uint8_t address) {
    return (address >= 0x0D && address <= 0x38) || (address >= 0x67 && address <= 0x6C);
  }

  void PowerOn() {
    std::fill(std::begin(registers_), std::end(registers_), uint8_t{0});
    registers_[kPower] = kSleep;
    registers_[kWhoAmI] = identity_;
    filtered_deg_s_ = 0.0;
  }

  /// Take the newest sample. One pole stands for the low-pass filter. No data sheet says what it reads while
  /// it starts up: full scale here.
  void Latch() {
    if ((registers_[kPower] & kSleep) != 0 || frozen_) return;
    if (time_s_ < measures_from_s_) {
      registers_[kGyroZ] = 0x7F;
      registers_[kGyroZ + 1] = 0xFF;
      return;
    }
    constexpr double kSample_s = 0.001;
    if (time_s_ - sampled_s_ < kSample_s) return;
    constexpr double kBandwidth_Hz[8] = {256.0, 188.0, 98.0, 42.0, 20.0, 10.0, 5.0, 256.0};
    const double bandwidth_Hz = kBandwidth_Hz[registers_[kConfig] & 7];
    const double rate_deg_s = yaw_rad_s_ * (upside_down_ ? -1.0 : 1.0) * 180.0 / M_PI;
    const double keep = std::exp(-2.0 * M_PI * bandwidth_Hz * (time_s_ - sampled_s_));
    filtered_deg_s_ = rate_deg_s + keep * (filtered_deg_s_ - rate_deg_s);
    sampled_s_ = time_s_;
    constexpr double kNoise_deg_s_sqrt_Hz = 0.005;
    const double noise_deg_s = kNoise_deg_s_sqrt_Hz * std::sqrt(bandwidth_Hz) * random_.Normal();
    constexpr double kLsb_per_deg_s[4] = {131.0, 65.5, 32.8, 16.4};
    const double lsb =
        (filtered_deg_s_ + bias_deg_s_ + noise_deg_s) * kLsb_per_deg_s[registers_[kGyroConfig] >> 3 & 3];
    const int value = static_cast<int>(std::lround(std::clamp(lsb, -32768.0, 32767.0)));
    registers_[kGyroZ] = static_cast<uint8_t>(value >> 8 & 0xFF);
    registers_[kGyroZ + 1] = static_cast<uint8_t>(value & 0xFF);
  }

  Random random_;
  bool fitted_ = false, powered_ = false, frozen_ = false, upside_down_ = false, expects_register_ = false;
  int held_pulses_ = 0;
  bool clock_held_ = false;
  uint8_t pointer_ = 0, identity_ = 0;
  uint8_t registers_[128];
  double bias_deg_s_ = 0.0, yaw_rad_s_ = 0.0, filtered_deg_s_ = 0.0, sampled_s_ = 0.0;
  double time_s_ = 0.0, measures_from_s_ = 0.0;
};

}  // namespace thumper
