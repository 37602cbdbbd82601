#pragma once
#include <cstdint>

#include "avr.hpp"

namespace thumper {

/// How one motor's bridge hangs on the chip. Its PWM pin is bit 3 of both ports on every board: Timer 2's.
struct MotorWiring {
  uint16_t port, ddr;  // registers of the port that all its pins are on
  int forward_bit;     // high: forward
  int reverse_bit;     // of a TB6612 or L298N, the bridge's second input; kNone: forward_bit alone decides
  int brake_bit;       // kNone: no such pin
};

struct EncoderWiring {
  char port;
  int a_bit, b_bit;
};

/// What is wired to which pin, as firmware/board/trex.hpp and nano.hpp say from the other side. Pairs are
/// left, right.
struct Wiring {
  static constexpr int kNone = -1;
  MotorWiring motor[2];
  EncoderWiring encoder[2];
  int battery_channel, current_channel[2];
};

constexpr Wiring kTrexWiring = {
    {{reg::kPortD, reg::kDdrD, 2, Wiring::kNone, 4}, {reg::kPortB, reg::kDdrB, 2, Wiring::kNone, 1}},
    {{'D', 5, 6}, {'B', 4, 5}},
    3,
    {6, 7}};

constexpr Wiring kNanoWiring = {
    {{reg::kPortD, reg::kDdrD, 2, 4, Wiring::kNone}, {reg::kPortB, reg::kDdrB, 2, 4, Wiring::kNone}},
    {{'D', 5, 6}, {'B', 0, 1}},
    3,
    {4, 5}};

/// By the board's number in the protocol's `identity`; null for a number that no board has.
inline const Wiring* FindWiring(int board) {
  switch (board) {
    case 1:
      return &kTrexWiring;
    case 2:
      return &kNanoWiring;
    default:
      return nullptr;
  }
}

}  // namespace thumper
