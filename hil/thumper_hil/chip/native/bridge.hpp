#pragma once
#include "wiring.hpp"

namespace thumper {

/// Inputs of one H-bridge from the chip's pins, averaged over a PWM period.
struct BridgeCommand {
  double duty = 0.0;     // 0...1
  bool forward = false;  // direction pin
  bool brake = false;    // brake pin: the duty then sets the braking strength
};

/// Open winding: only friction slows the wheels.
constexpr BridgeCommand kCoast = {0.0, false, true};

/// Reads the motor pins. The PWM pins are D3 (OC2B) on the left and D11 (OC2A) on the right.
///
/// simavr has no phase-correct PWM, so the duty comes from the registers of Timer 2. As on the chip, a new
/// compare value takes effect when the timer reaches TOP (data sheet 17.7.4), up to one PWM period after the
/// write.
class BridgePins {
 public:
  static constexpr int kPwmBit = 3;  // of both ports

  /// `low_coasts`: true if a PWM pin that stays low opens the bridge, false if it shorts the winding.
  BridgePins(avr_t* avr, const Wiring& wiring, bool low_coasts)
      : avr_(avr), wiring_(wiring), low_coasts_(low_coasts) {}

  /// Sample the registers now. Call at least once per millisecond.
  void Sample() {
    const uint8_t mode = Mode();
    const uint32_t prescaler = Prescaler();
    if (prescaler != prescaler_) {
      prescaler_ = prescaler;
      start_cycle_ = avr_->cycle;
    }
    if (mode != kPhaseCorrect || prescaler == 0) {
      compare_[kLeft] = avr_->data[reg::kOcr2B];
      compare_[kRight] = avr_->data[reg::kOcr2A];
      return;
    }
    constexpr uint64_t kPeriodTicks = 510, kTopTick = 255;
    const uint64_t ticks = (avr_->cycle - start_cycle_) / prescaler;
    const uint64_t tops = (ticks + kPeriodTicks - kTopTick) / kPeriodTicks;
    if (tops != tops_) {
      tops_ = tops;
      compare_[kLeft] = avr_->data[reg::kOcr2B];
      compare_[kRight] = avr_->data[reg::kOcr2A];
    }
  }

  /// Whether Timer 2 controls both PWM pins.
  bool pwm_running() const {
    constexpr uint8_t kBothOutputs = 0xA0;  // upper bit of both channels' compare output mode
    return (avr_->data[reg::kTccr2A] & kBothOutputs) == kBothOutputs;
  }

  BridgeCommand left() const { return Command(kLeft, 4); }
  BridgeCommand right() const { return Command(kRight, 6); }

 private:
  enum Side { kLeft, kRight };
  static constexpr uint8_t kPhaseCorrect = 1, kFast = 3;

  uint8_t Mode() const { return (avr_->data[reg::kTccr2A] & 3u) | ((avr_->data[reg::kTccr2B] >> 1) & 4u); }

  uint32_t Prescaler() const {
    static constexpr uint32_t kPrescaler[8] = {0, 1, 8, 32, 64, 128, 256, 1024};
    return kPrescaler[avr_->data[reg::kTccr2B] & 7u];
  }

  bool Driven(const MotorWiring& motor, int bit) const {
    return bit != Wiring::kNone && ((avr_->data[motor.ddr] & avr_->data[motor.port]) >> bit & 1) != 0;
  }

  /// `com_shift`: position of the channel's compare output mode in TCCR2A.
  BridgeCommand Command(Side side, int com_shift) const {
    const MotorWiring& motor = wiring_.motor[side];
    if (((avr_->data[motor.ddr] >> kPwmBit) & 1u) == 0) return kCoast;  // a floating pin drives no transistor
    const bool forward = Driven(motor, motor.forward_bit);
    const bool reverse = Driven(motor, motor.reverse_bit);
    // Bridge with two inputs: both high shorts the motor, both low opens it, whatever the PWM.
    if (motor.reverse_bit != Wiring::kNone && forward == reverse) return {forward ? 1.0 : 0.0, false, true};
    const double duty = Duty(side, com_shift);
    if (duty == 0.0 && low_coasts_) return kCoast;
    return {duty, forward, Driven(motor, motor.brake_bit)};
  }

  double Duty(Side side, int com_shift) const {
    const int output_mode = (avr_->data[reg::kTccr2A] >> com_shift) & 3;
    if (output_mode < 2 || prescaler_ == 0) return Driven(wiring_.motor[side], kPwmBit) ? 1.0 : 0.0;
    const double duty = Mode() == kFast ? (compare_[side] + 1) / 256.0 : compare_[side] / 255.0;
    return output_mode == 2 ? duty : 1.0 - duty;
  }

  avr_t* avr_;
  const Wiring& wiring_;
  bool low_coasts_;
  uint8_t compare_[2] = {0, 0};
  uint32_t prescaler_ = 0;
  uint64_t start_cycle_ = 0, tops_ = 0;
};

}  // namespace thumper
