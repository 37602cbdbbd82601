#pragma once
#include <avr/io.h>

#include "core/messages.hpp"

/// Pin map of the DAGU T'REX DG010. Its INT0 and INT1 pins drive motors, so the encoders use pin-change
/// interrupts.
/// Wiring: the direction pin high drives a side forward, and A leads B while it rolls forward. If the
/// mirrored side of a robot runs backwards, swap that side's two motor wires or its two encoder wires.
namespace pins {

constexpr fw::Board kBoard = fw::Board::kTrex;

// Left motor, port D: PWM D3 (OC2B), direction D2, brake D4 (kept low).
constexpr uint8_t kLeftPwm = 1 << PD3, kLeftOutputs = 1 << PD2 | 1 << PD3 | 1 << PD4;
constexpr uint8_t kLeftForward = 1 << PD2, kLeftReverse = 0;
// Right motor, port B: PWM D11 (OC2A), direction D10, brake D9 (kept low).
constexpr uint8_t kRightPwm = 1 << PB3, kRightOutputs = 1 << PB1 | 1 << PB2 | 1 << PB3;
constexpr uint8_t kRightForward = 1 << PB2, kRightReverse = 0;

// Encoders on adjacent bits, A on the lower one; one port and one vector per wheel. Left A/B: D5/D6,
// PCINT21/22. Right A/B: D12/D13, PCINT4/5.
constexpr uint8_t kLeftEncoder = 1 << PD5 | 1 << PD6, kRightEncoder = 1 << PB4 | 1 << PB5;

// ADC channels: battery A3, currents A6 and A7. Some boards have the two currents swapped.
constexpr uint8_t kBatteryChannel = 3, kLeftCurrentChannel = 6, kRightCurrentChannel = 7;

// Accelerometer: x, y, z at ADC channels 0, 1, 2.
constexpr bool kHasAccelerometer = true;

// Protecting inputs, with pull-ups: 1 at D7, 2 at D8.
inline void StartInputs() {
  PORTD |= 1 << PD7;
  PORTB |= 1 << PB0;
}
/// Return their levels: bit 0 is input 1, bit 1 is input 2.
inline uint8_t ReadInputs() {
  return static_cast<uint8_t>(((PIND & 1 << PD7) != 0 ? 1 : 0) | ((PINB & 1 << PB0) != 0 ? 2 : 0));
}

}  // namespace pins
