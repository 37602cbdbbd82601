// Wiring and schedule: what each interrupt does and what the main loop does between them. No arithmetic.

#include <avr/interrupt.h>
#include <avr/sleep.h>
#include <util/atomic.h>

#include "board/adc.hpp"
#include "board/beeper.hpp"
#include "board/clock.hpp"
#include "board/eeprom.hpp"
#include "board/encoder_edge.hpp"
#include "board/encoders.hpp"
#include "board/motors.hpp"
#include "board/mpu6050.hpp"
#include "board/pins.hpp"
#include "board/reset.hpp"
#include "board/tick.hpp"
#include "board/uart.hpp"
#include "board/uart_interrupts.hpp"
#include "board/watchdog.hpp"
#include "core/beep.hpp"
#include "core/drive.hpp"
#include "core/host_interface.hpp"
#include "core/quadrature.hpp"

namespace {

// Shared with interrupts. Unless noted, the main loop accesses these only with interrupts off.
Uart uart;
Adc adc;
motors::Drive drive;
Beeper beeper(drive);
using LeftEncoder = fw::QuadratureDecoder<pins::kLeftEncoder>;
using RightEncoder = fw::QuadratureDecoder<pins::kRightEncoder>;
LeftEncoder left_encoder;
RightEncoder right_encoder;
fw::DriveCommand command;
volatile uint8_t milliseconds = 0;  // wraps

// Double buffer: the main loop writes the inactive one, then makes it active.
fw::WheelConfig configs[2];
volatile uint8_t active_config = 0;

// Written by the control tick. The main loop reads them between two ticks.
fw::Side left_side, right_side;
fw::Samples samples;
volatile uint8_t ticks = 0;  // since the main loop last collected them

static_assert(
    2UL * 10 * fw::kControlRate_Hz * (sizeof(fw::Frame<fw::Telemetry>) + 2) <= THUMPER_BAUD,
    "telemetry takes more than half of the line: choose a higher baud rate or a lower control rate");

}  // namespace

ISR(PCINT2_vect, ISR_NAKED) { encoders::StepOnEdge<LeftEncoder, left_encoder>(_SFR_IO_ADDR(PIND)); }
ISR(PCINT0_vect, ISR_NAKED) { encoders::StepOnEdge<RightEncoder, right_encoder>(_SFR_IO_ADDR(PINB)); }
ISR(USART_RX_vect, ISR_NAKED) { uart_interrupts::OnReceive<uart>(_SFR_MEM_ADDR(UDR0)); }
ISR(USART_UDRE_vect, ISR_NAKED) { uart_interrupts::OnReady<uart>(_SFR_MEM_ADDR(UDR0)); }
ISR(TIMER0_COMPB_vect) { beeper.End(); }
ISR(TWI_vect, ISR_NAKED) { Mpu6050::OnDone(); }

ISR(WDT_vect) {
  motors::Halt();
  reset::Restart();
}

// The next three interrupts run longer, so they let encoders and serial port interrupt them. They cannot nest
// in themselves: the next one is a millisecond (or a control period) away.
ISR(TIMER0_COMPA_vect, ISR_NOBLOCK) {
  if (beeper.sounding() && !beeper.Begin()) return;
  ++milliseconds;
  adc.Step();
}

ISR(ADC_vect, ISR_NOBLOCK) {
  if (pins::kHasAccelerometer) adc.ConvertAxis();
}

// The main loop cannot run in between, so what it has written is consistent.
ISR(TIMER1_COMPA_vect, ISR_NOBLOCK) {
  cli();
  const uint16_t left_count = left_encoder.count();
  const uint16_t right_count = right_encoder.count();
  const uint16_t left_lost = left_encoder.lost(), right_lost = right_encoder.lost();
  sei();
  samples.lost_edges = static_cast<uint16_t>(left_lost + right_lost);
  const fw::WheelConfig& config = active_config == 0 ? configs[0] : configs[1];
  left_side.Step(command.mode, config, command.left, left_count, config.left_encoder_reversed, &samples.left);
  right_side.Step(command.mode, config, command.right, right_count, config.right_encoder_reversed,
                  &samples.right);
  samples.time_us += fw::kTick_us;
  drive.Set(samples.left.wheel.pwm, samples.right.wheel.pwm);
  ++ticks;
}

namespace {

/// Apply the host interface's command to the control tick. If it is not driving, stop the motors at once.
/// Store the latched fault where it survives a reset.
void Apply(const fw::HostInterface& host) {
  const fw::DriveCommand& wanted = host.command();
  const fw::State mode = wanted.mode;
  const int16_t left = wanted.left, right = wanted.right;
  if (host.supervisor().armed()) beeper.Sound(false);  // before a tick may drive
  ATOMIC_BLOCK(ATOMIC_FORCEON) {  // only these three stores: the encoder interrupts must not wait
    command.mode = mode;
    command.left = left;
    command.right = right;
  }
  if (!host.supervisor().armed()) drive.Off();  // a tick in between would do the same
  reset::Keep(host.supervisor().fault());
}

/// Compute new controller constants after a change of parameters or battery voltage.
void Configure(const fw::HostInterface& host) {
  const uint8_t next = active_config ^ 1;
  host.parameters().Derive(host.battery_mV(), &configs[next]);
  __asm__ volatile("" ::: "memory");  // complete before the tick may read it
  active_config = next;
  // The robot's own parameters change only while the motors are off.
  const fw::Parameters& robot = host.parameters();
  drive.SetReversed(robot.IsSet(fw::Parameter::kLeftMotorReversed),
                    robot.IsSet(fw::Parameter::kRightMotorReversed));
  motors::SetFrequency(robot.Get(fw::Parameter::kPwmFrequency));
  adc.SetCurrentsAtA4(robot.IsSet(fw::Parameter::kCurrentsAtA4));
  adc.UseAccelerometer(robot.IsSet(fw::Parameter::kTiltLimit) || robot.IsSet(fw::Parameter::kImpactLimit));
}

/// Copy the control tick's samples. Repeat if a tick interrupted the copy. Return the ticks since the last
/// call.
uint8_t Collect(fw::Samples* copy) {
  uint8_t taken = 0;
  do {
    ATOMIC_BLOCK(ATOMIC_FORCEON) {
      taken = static_cast<uint8_t>(taken + ticks);
      ticks = 0;
    }
    *copy = samples;
    __asm__ volatile("" ::: "memory");
  } while (ticks != 0);
  return taken;
}

/// Sleep until an interrupt leaves work to do. The instruction after sei still runs with interrupts off, so
/// no interrupt can slip in before the sleep.
void Idle(const Mpu6050& gyroscope, uint8_t handled_ms) {
  cli();
  if (ticks == 0 && milliseconds == handled_ms && uart.empty() && !gyroscope.due()) {
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
  left_encoder.Reset(PIND);
  right_encoder.Reset(PINB);
  pins::StartInputs();
  Mpu6050::Start();
  uart.Start();
  clock::Start();
  tick::Start();
  set_sleep_mode(SLEEP_MODE_IDLE);

  // Static, so that the size budget includes them.
  static Eeprom eeprom;
  static fw::HostInterface host(pins::kBoard, reset::Cause());
  static fw::BeepPattern beeps;
  static Mpu6050 gyroscope_memory;
  Mpu6050* gyroscope = &gyroscope_memory;
  __asm__("" : "+r"(gyroscope));  // a constant address costs 150 bytes
  host.Start(eeprom, reset::Kept());
  watchdog::Start();
  uint8_t handled_ms = 0;
  bool clock_runs = false;
  sei();

  for (;;) {
    // At most 64 bytes per pass, so that a host that never pauses cannot starve time-out and watchdog.
    uint8_t byte = 0;
    for (uint8_t left = 64; left != 0 && uart.Get(&byte); --left) {
      if (!host.Receive(byte, uart)) continue;
      if (host.supervisor().armed() && host.TakeChange()) Configure(host);  // before a tick may drive
      Apply(host);
    }
    host.StepStore(eeprom, uart);
    if (gyroscope->due()) gyroscope->Step(host.stationary());

    const uint8_t now_ms = milliseconds;
    const uint8_t elapsed_ms = static_cast<uint8_t>(now_ms - handled_ms);
    handled_ms = now_ms;
    Adc::Sums sums;
    const bool measured = adc.Take(&sums);
    if (adc.stopped()) host.LoseAnalogReadings();
    if (measured) {
      if (host.UpdateBattery(fw::BatteryFromSum_mV(sums.battery))) beeps.Start(fw::kLowBatteryBeeps);
      const int16_t scale = host.parameters().Get(fw::Parameter::kCurrentScale);
      const int16_t zero = host.parameters().Get(fw::Parameter::kCurrentZero);
      host.UpdateCurrents(fw::CurrentFromSum_mA(sums.left_current, scale, zero),
                          fw::CurrentFromSum_mA(sums.right_current, scale, zero));
    }
    if (host.TakeChange() || measured) Configure(host);
    if (elapsed_ms != 0) {
      clock_runs = true;
      host.AdvanceTime(elapsed_ms);
      host.UpdateInputs(pins::ReadInputs());
      uint8_t axes[3];
      if (pins::kHasAccelerometer && adc.TakeAxes(&axes)) host.UpdateAcceleration(axes);
      Apply(host);
      tick::Hold();
      if (!beeper.sounding()) drive.AfterMillisecond();
      tick::Release();
      beeper.Sound(beeps.Step(elapsed_ms, host.quiet()));
      gyroscope->AfterMilliseconds(elapsed_ms,
                                   static_cast<uint8_t>(host.parameters().Get(fw::Parameter::kGyroscope)));
    }
    if (ticks != 0) {
      // If the millisecond interrupt dies, no link time-out can occur. Then the watchdog must act.
      if (clock_runs) watchdog::Kick();
      clock_runs = false;
      host.CountDropped(static_cast<uint8_t>(Collect(host.samples()) - 1));
      drive.MarkRests(&host.samples()->left.wheel.pwm, &host.samples()->right.wheel.pwm);
      host.Watch();
      Apply(host);
      host.SendTelemetry(uart, gyroscope->heading(), gyroscope->state());
    }
    Idle(*gyroscope, handled_ms);
  }
}
