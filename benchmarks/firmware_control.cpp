// Steps of the control law between two writes to GPIOR0, on a simulated motor. Used by firmware.py.
#include <avr/io.h>
#include <avr/sleep.h>

#include "core/parameters.hpp"

namespace {

constexpr int kSteps = 200;
volatile int16_t target_mrad_s, error_mrad_s;
volatile int16_t sink;

/// Roughly a first-order wheel, because the work of a step depends on the loop's state.
int16_t Respond(int16_t counts, int16_t pwm) { return static_cast<int16_t>(counts + (pwm - counts) / 2); }

int16_t Target(int step) {
  return static_cast<int16_t>(step < 50 ? 8000 : step < 100 ? -17000 : step < 150 ? 17000 : 0);
}

}  // namespace

int main() {
  static fw::WheelController wheel;
  static fw::PiController pi;
  fw::WheelConfig config;
  fw::Parameters().Derive(7400, &config);
  fw::WheelSample sample = {};
  int16_t counts = 0;
#if defined(MEASURE_PI)
  for (int step = 0; step < kSteps; ++step) {
    error_mrad_s = fw::Difference(Target(step), fw::SpeedFromCounts(config.speed, counts));
    const int16_t error = error_mrad_s;
    GPIOR0 = 1;
    const int16_t pwm = pi.Step(config.pi, error, 0, false);
    GPIOR0 = 0;
    sink = pwm;
    counts = Respond(counts, pwm);
  }
#else
  for (int step = 0; step < kSteps; ++step) {
    target_mrad_s = Target(step);
    const int16_t target = target_mrad_s;
    GPIOR0 = 1;
    wheel.Step(config, target, fw::SpeedFromCounts(config.speed, counts), &sample);
    GPIOR0 = 0;
    sink = sample.pwm;
    counts = Respond(counts, sample.pwm);
  }
#endif
  sink = static_cast<int16_t>(sample.integral_pwm_64 + pi.integral());
  for (;;) {
  }
}
