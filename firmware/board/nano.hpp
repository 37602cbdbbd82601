#pragma once
#include <avr/io.h>

#include "core/messages.hpp"

/// Pin map of an Arduino Nano or Uno with a TB6612 or L298N driver. Wiring: docs/howto/nano-uno.md.
namespace pins {

constexpr fw::Board kBoard = fw::Board::kNano;

// Left motor, port D: PWM D3 (OC2B), bridge inputs 1 and 2 at D2 and D4.
constexpr uint8_t kLeftPwm = 1 << PD3, kLeftOutputs = 1 << PD2 | 1 << PD3 | 1 << PD4;
constexpr uint8_t kLeftForward = 1 << PD2, kLeftReverse = 1 << PD4;
// Right motor, port B: PWM D11 (OC2A), bridge inputs 1 and 2 at D10 and D12.
constexpr uint8_t kRightPwm = 1 << PB3, kRightOutputs = 1 << PB2 | 1 << PB3 | 1 << PB4;
constexpr uint8_t kRightForward = 1 << PB2, kRightReverse = 1 << PB4;

// Encoders on adjacent bits, A on the lower one; one port and one vector per wheel. Left A/B: D5/D6,
// PCINT21/22. Right A/B: D8/D9, PCINT0/1. D13 stays free, because its LED would load an open collector.
constexpr uint8_t kLeftEncoder = 1 << PD5 | 1 << PD6, kRightEncoder = 1 << PB0 | 1 << PB1;

// ADC channels: battery A3, currents A6 and A7. A4 and A5 belong to the gyroscope.
constexpr uint8_t kBatteryChannel = 3, kLeftCurrentChannel = 6, kRightCurrentChannel = 7;

constexpr bool kHasAccelerometer = false;

// Protecting inputs, with pull-ups: 1 at A0, 2 at A1.
inline void StartInputs() { PORTC |= 1 << PC0 | 1 << PC1; }
/// Return their levels: bit 0 is input 1, bit 1 is input 2.
inline uint8_t ReadInputs() { return PINC & (1 << PC0 | 1 << PC1); }

}  // namespace pins
