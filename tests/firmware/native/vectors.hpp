#pragma once
#include <stdint.h>

#include "core/acceleration.hpp"
#include "core/battery.hpp"
#include "core/crc.hpp"
#include "core/gyro_heading.hpp"
#include "core/parameters.hpp"
#include "core/quadrature.hpp"
#include "core/wheel.hpp"

/// The same pseudo-random run of the core in the host build and on the chip. Every result goes to
/// `sink.Put(int32_t)`. `int` has 32 bits on one and 16 on the other, so any dependence on it shows here.
namespace vectors {

class Random {
 public:
  /// Uniform in [low, high], high - low < 2^31.
  int32_t Between(int32_t low, int32_t high) {
    state_ = state_ * 1664525UL + 1013904223UL;
    return low + static_cast<int32_t>((state_ >> 1) % (static_cast<uint32_t>(high - low) + 1));
  }

 private:
  uint32_t state_ = 1;
};

template <typename Sink>
void RunPi(Random& random, Sink& sink) {
  fw::PiController pi;
  fw::PiGains gains = {};
  for (uint16_t i = 0; i < 3000; ++i) {
    if (i % 100 == 0) {
      gains.kp = static_cast<int16_t>(random.Between(0, fw::kParameterRanges[0].maximum));
      gains.ki = static_cast<int16_t>(random.Between(0, fw::kParameterRanges[1].maximum));
    }
    const int32_t span = i % 7 == 0 ? INT16_MAX : 2000;
    const int16_t error = i % 50 == 0 ? 0 : static_cast<int16_t>(random.Between(-span, span));
    const int32_t feed_forward = random.Between(-fw::OutputFromPwm(300), fw::OutputFromPwm(300));
    sink.Put(pi.Step(gains, error, feed_forward, i % 50 == 0));
    sink.Put(pi.integral());
  }
}

template <typename Sink>
void RunWheel(Random& random, Sink& sink) {
  fw::WheelController wheel;
  fw::Parameters parameters;
  fw::WheelConfig config;
  fw::WheelSample sample;
  int16_t target = 0;
  for (uint16_t i = 0; i < 3000; ++i) {
    if (i % 60 == 0) {
      for (uint8_t p = 0; p < fw::kParameterCount; ++p) {
        parameters.Set(p, static_cast<int16_t>(random.Between(
                              0, fw::ReadFlash(&fw::kParameterRanges[p].maximum) >> (i % 3 * 2))));
      }
    }
    if (i % 15 == 0) target = static_cast<int16_t>(random.Between(-17000, 17000));
    const int16_t counts = static_cast<int16_t>(random.Between(-400, 400));
    const uint16_t battery_mV = static_cast<uint16_t>(random.Between(0, 9000));
    parameters.Derive(battery_mV, &config);
    wheel.Step(config, target, fw::SpeedFromCounts(config.speed, counts), &sample);
    sink.Put(sample.speed_mrad_s);
    sink.Put(sample.setpoint_mrad_s);
    sink.Put(sample.pwm);
    sink.Put(sample.integral_pwm_64);
  }
}

template <typename Sink>
void RunSmallParts(Random& random, Sink& sink) {
  fw::Battery battery;
  fw::QuadratureDecoder<0x30> decoder;
  uint16_t crc = fw::kCrcInit;
  for (uint16_t i = 0; i < 1000; ++i) {
    const int16_t a = static_cast<int16_t>(random.Between(-32768, 32767));
    const int16_t b = static_cast<int16_t>(random.Between(-32768, 32767));
    sink.Put(fw::Product(a, b));
    sink.Put(fw::Difference(a, b));
    const uint16_t sum = static_cast<uint16_t>(random.Between(0, 1023 * fw::kAdcSamples));
    sink.Put(static_cast<int32_t>(battery.Update(fw::BatteryFromSum_mV(sum), {6400, 7000, 9000})));
    sink.Put(battery.filtered_mV());
    const int16_t scale = static_cast<int16_t>(random.Between(512, 30720));
    sink.Put(fw::CurrentFromSum_mA(sum, scale, static_cast<int16_t>(random.Between(0, 1023))));
    const fw::SpeedScale speed = fw::MakeSpeedScale(static_cast<uint16_t>(random.Between(40, 30000)));
    sink.Put(fw::SpeedFromCounts(speed, static_cast<int16_t>(random.Between(-32768, 32767))));
    decoder.Step(static_cast<uint8_t>(random.Between(0, 255)));
    sink.Put(decoder.count());
    sink.Put(decoder.lost());
    crc = fw::Crc16(crc, static_cast<uint8_t>(random.Between(0, 255)));
    sink.Put(crc);
  }
}

/// Still for a while, then turning, at rates over the whole range.
template <typename Sink>
void RunGyro(Random& random, Sink& sink) {
  fw::GyroHeading gyro;
  for (uint16_t i = 0; i < 4000; ++i) {
    const bool still = i % 2000 < 1200;
    const int32_t rate = still ? random.Between(-400, -390) : random.Between(-32768, 32767);
    sink.Put(gyro.Measure(static_cast<int16_t>(rate), still));
    gyro.Advance(static_cast<uint8_t>(random.Between(0, 255)));
    sink.Put(gyro.heading());
  }
  sink.Put(gyro.calibrated());
}

/// Small and large changes, so that each limit is met and missed.
template <typename Sink>
void RunAcceleration(Random& random, Sink& sink) {
  fw::AccelerationMonitor monitor;
  uint8_t reading[3] = {};
  for (uint16_t i = 0; i < 4000; ++i) {
    const int32_t spread = i % 9 == 0 ? 127 : 3;
    for (uint8_t& axis : reading) axis = static_cast<uint8_t>(axis + random.Between(-spread, spread));
    const int16_t tilt = static_cast<int16_t>(random.Between(-76, 76));
    const int16_t impact = static_cast<int16_t>(random.Between(0, 154));
    sink.Put(static_cast<int32_t>(monitor.Step(reading, tilt, impact)));
  }
}

template <typename Sink>
void Run(Sink& sink) {
  Random random;
  RunPi(random, sink);
  RunWheel(random, sink);
  RunSmallParts(random, sink);
  RunGyro(random, sink);
  RunAcceleration(random, sink);
}

}  // namespace vectors
