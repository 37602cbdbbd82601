// Wiring and schedule: which interrupt does what, and what the main loop does between them. No arithmetic.

#include <avr/interrupt.h>
#include <avr/sleep.h>
#include <util/atomic.h>

#include "board/adc.hpp"
#include "board/beeper.hpp"
#include "board/clock.hpp"
#include "board/encoders.hpp"
#include "board/motors.hpp"
#include "board/pins.hpp"
#include "board/reset.hpp"
#include "board/tick.hpp"
#include "board/uart.hpp"
#include "core/beep.hpp"
#include "core/drive.hpp"
#include "core/host_interface.hpp"
#include "core/quadrature.hpp"

namespace {

/// What the control tick leaves for telemetry.
struct Snapshot {
  uint32_t time_us;
  fw::SideSample left, right;
  uint16_t lost_edges;
};

// Shared with interrupts: touched by the main loop with interrupts off only.
Uart uart;
Adc adc;
Beeper beeper;
fw::QuadratureDecoder left_encoder, right_encoder;
fw::DriveInput drive_input;
Snapshot snapshot;
volatile bool ticked = false;
volatile uint8_t milliseconds = 0;

// The control tick's own.
fw::Side left_side, right_side;

}  // namespace

ISR(PCINT2_vect) { left_encoder.Step(pins::LeftAb()); }
ISR(PCINT0_vect) { right_encoder.Step(pins::RightAb()); }
ISR(USART_RX_vect) { uart.OnReceive(); }
ISR(USART_UDRE_vect) { uart.OnReady(); }
ISR(TIMER0_COMPB_vect) { beeper.End(); }

ISR(TIMER0_COMPA_vect) {
  if (beeper.sounding() && !beeper.Begin()) return;
  ++milliseconds;
  adc.Step();
}

// Long, so encoders and serial port may interrupt it. The main loop cannot: its writes to drive_input stay
// whole.
ISR(TIMER1_COMPA_vect, ISR_NOBLOCK) {
  uint16_t left_count = 0, right_count = 0, lost_edges = 0;
  ATOMIC_BLOCK(ATOMIC_FORCEON) {
    left_count = left_encoder.count();
    right_count = right_encoder.count();
    lost_edges = static_cast<uint16_t>(left_encoder.lost() + right_encoder.lost());
  }
  snapshot.left = left_side.Step(drive_input, drive_input.command.left, left_count);
  snapshot.right = right_side.Step(drive_input, drive_input.command.right, right_count);
  snapshot.lost_edges = lost_edges;
  snapshot.time_us += fw::kTick_us;
  ATOMIC_BLOCK(ATOMIC_FORCEON) {
    if (!beeper.sounding()) motors::Set(snapshot.left.wheel.pwm, snapshot.right.wheel.pwm);
  }
  ticked = true;
}

namespace {

/// Hand the motors' permission and targets to the control tick; whatever is not driving stops here and now.
void Obey(const fw::HostInterface& host) {
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    drive_input.command = host.command();
    if (host.supervisor().armed()) {
      beeper.Sound(false);
    } else {
      motors::Off();
    }
  }
}

void Configure(const fw::HostInterface& host) {
  const fw::WheelConfig config = host.config();
  const uint16_t supply_ratio = fw::SupplyRatio(host.battery_mV());
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    drive_input.config = config;
    drive_input.supply_ratio = supply_ratio;
  }
}

void SendTelemetry(const fw::HostInterface& host, const Adc::Sums& sums, uint8_t seq) {
  Snapshot now;
  uint16_t uart_errors = 0;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    now = snapshot;
    uart_errors = uart.errors();
  }
  fw::Telemetry message;
  message.time_us = now.time_us;
  message.left_count = now.left.count;
  message.right_count = now.right.count;
  message.left_speed = now.left.wheel.speed_mrad_s;
  message.right_speed = now.right.wheel.speed_mrad_s;
  message.left_setpoint = now.left.wheel.setpoint_mrad_s;
  message.right_setpoint = now.right.wheel.setpoint_mrad_s;
  message.left_pwm = now.left.wheel.pwm;
  message.right_pwm = now.right.wheel.pwm;
  message.left_integral = now.left.integral_pwm_64;
  message.right_integral = now.right.integral_pwm_64;
  message.battery_mV = host.battery_mV();
  message.left_current_mA = fw::CurrentFromSum_mA(sums.left_current);
  message.right_current_mA = fw::CurrentFromSum_mA(sums.right_current);
  message.state = host.supervisor().state();
  message.fault = host.supervisor().fault();
  message.rx_errors = static_cast<uint16_t>(host.rx_errors() + uart_errors);
  message.lost_edges = now.lost_edges;
  fw::SendFrame(uart, seq, message);
}

/// True while the motors are off and the wheels stood still in the last interval.
bool Quiet(const fw::HostInterface& host) {
  bool standing = false;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
    standing = snapshot.left.wheel.speed_mrad_s == 0 && snapshot.right.wheel.speed_mrad_s == 0;
  }
  return standing && !host.supervisor().armed();
}

/// Sleep until an interrupt leaves work. The instruction after sei is still protected, so none can slip in
/// between.
void Idle() {
  cli();
  if (!ticked && milliseconds == 0 && uart.empty()) {
    sleep_enable();
    sei();
    sleep_cpu();
    sleep_disable();
  }
  sei();
}

}  // namespace

int main() {
  motors::Start();
  encoders::Start();
  left_encoder.Reset(pins::LeftAb());
  right_encoder.Reset(pins::RightAb());
  adc.Start();
  uart.Start();
  clock::Start();
  tick::Start();
  set_sleep_mode(SLEEP_MODE_IDLE);

  // Static, so that its size shows in the budget.
  static fw::HostInterface host(pins::kBoard, ReadResetCause());
  static fw::BeepPattern beeps;
  Adc::Sums sums = {0, 0, 0};
  uint8_t telemetry_seq = 0;
  Obey(host);
  Configure(host);
  sei();

  for (;;) {
    uint8_t byte = 0;
    while (uart.Get(&byte)) {
      if (host.Receive(byte, uart)) {
        Obey(host);
        Configure(host);
      }
    }

    uint8_t elapsed_ms = 0;
    bool measured = false;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
      elapsed_ms = milliseconds;
      milliseconds = 0;
      measured = adc.Take(&sums);
    }
    if (measured) {
      if (host.UpdateBattery(fw::BatteryFromSum_mV(sums.battery))) beeps.Start(fw::kLowBatteryBeeps);
      Configure(host);
    }
    if (elapsed_ms != 0) {
      host.Wait(elapsed_ms);
      Obey(host);
      const bool sound = beeps.Step(elapsed_ms, Quiet(host));
      ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { beeper.Sound(sound); }
    }
    if (ticked) {
      ticked = false;
      SendTelemetry(host, sums, telemetry_seq++);
    }
    Idle();
  }
}
