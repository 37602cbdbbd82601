#pragma once
#include <avr/io.h>

#include "board/pins.hpp"
#include "core/units.hpp"

/// ADC of battery and motor currents, one conversion per millisecond in turn. A PWM period is 8.2 ms, so a
/// single sample sees either its on or its off phase. Each reading is a sum of 32 samples over 96 ms.
/// A conversion that has not finished after its millisecond gives no sample, and stopped() reports when there
/// are none: the data register would keep the last value for ever.
///
/// If the accelerometer is used, each of these conversions is followed by one of its three axes.
class Adc {
 public:
  struct Sums {
    uint16_t battery, left_current, right_current;
  };

  /// Select the pins of the motor currents: those of the board, or A4 and A5. Written by the main loop; a
  /// wrong sample in between is one of 32.
  void SetCurrentsAtA4(bool at_a4) { currents_at_a4_ = at_a4; }

  /// Read the accelerometer, too. Written by the main loop.
  void UseAccelerometer(bool used) { axes_used_ = used; }

  /// Call once per millisecond from the interrupt: add the finished sample and start the next channel. The
  /// first call only starts.
  void Step() {
    if ((ADCSRA & 1 << ADIF) == 0) {
      if (silent_ms_ < kSilent_ms) ++silent_ms_;
      ADCSRA = 0;  // ends a conversion that hangs
      Convert();
      return;
    }
    silent_ms_ = 0;
    if (on_axis_) {
      on_axis_ = false;
      axes_[axis_] = ADCH;
      if (++axis_ == kAxes) {
        axis_ = 0;
        axes_complete_ = true;
      }
    } else {
      sample_ = ADC;
    }
    if (!axes_used_) {  // the next readings will begin a new series
      axis_ = 0;
      axes_[2] = 0;  // unknown
    }
    sums_[channel_] += sample_;
    if (++channel_ == kChannels) {
      channel_ = 0;
      if (++samples_ == fw::kAdcSamples) {
        samples_ = 0;
        done_ = {sums_[0], sums_[1], sums_[2]};
        sums_[0] = sums_[1] = sums_[2] = 0;
        ready_ = true;
      }
    }
    Convert();
  }

  /// Call from the interrupt at the end of a conversion: keep its result and convert an axis.
  void ConvertAxis() {
    sample_ = ADC;
    on_axis_ = true;
    ADMUX = 1 << REFS0 | 1 << ADLAR | axis_;
    ADCSRA = kOn | 1 << ADSC;
  }

  /// Return new readings of the accelerometer's axes, 8 bits of 5 V; false if there are none. If the main
  /// loop is late, some may be 3 ms newer than others.
  bool TakeAxes(uint8_t (*axes)[3]) {
    if (!axes_complete_ || !axes_used_) return false;
    axes_complete_ = false;
    (*axes)[0] = axes_[0];
    (*axes)[1] = axes_[1];
    (*axes)[2] = axes_[2];
    return true;
  }

  /// Return finished sums; false if there are no new ones. They stay for 96 ms.
  bool Take(Sums* sums) {
    if (!ready_) return false;
    __asm__ volatile("" ::: "memory");  // do not read them earlier
    ready_ = false;
    *sums = done_;
    return true;
  }

  /// True while the converter gives no results. Written by the interrupt.
  bool stopped() const { return silent_ms_ == kSilent_ms; }

 private:
  static constexpr uint8_t kChannels = 3, kAxes = 3;
  static constexpr uint8_t kSilent_ms = 50;
  static constexpr uint8_t kOn = 1 << ADEN | 1 << ADPS2 | 1 << ADPS1 | 1 << ADPS0;  // 125 kHz, 104 us each
  static_assert(kChannels * fw::kAdcSamples >= 9, "the average must span more than a PWM period");
  static_assert(fw::kAdcSamples * 1023UL <= 0xFFFF, "a sum must fit 16 bits");

  void Convert() {
    const uint8_t channel = channel_ == 0     ? pins::kBatteryChannel
                            : currents_at_a4_ ? static_cast<uint8_t>(3 + channel_)
                            : channel_ == 1   ? pins::kLeftCurrentChannel
                                              : pins::kRightCurrentChannel;
    ADMUX = 1 << REFS0 | channel;           // reference: AVCC
    ADCSRA = kOn | 1 << ADSC | 1 << ADIF |  // writing 1 clears the flag of the last conversion
             (pins::kHasAccelerometer && axes_used_ ? 1 << ADIE : 0);
  }

  uint8_t channel_ = 0, samples_ = 0;
  volatile uint8_t silent_ms_ = 0;
  uint16_t sums_[kChannels] = {0, 0, 0};
  Sums done_ = {0, 0, 0};
  volatile bool ready_ = false;
  bool currents_at_a4_ = false;
  uint16_t sample_ = 0;
  uint8_t axis_ = 0;
  volatile uint8_t axes_[kAxes] = {0, 0, 0};
  volatile bool axes_complete_ = false;
  bool on_axis_ = false, axes_used_ = false;
};
