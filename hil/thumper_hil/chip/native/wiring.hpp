#pragma once
#include <cstdint>

#include "avr.hpp"

namespace thumper {

/// Connection of one motor's bridge to the chip. Its PWM pin is bit 3 of the port on every board (Timer 2).
struct MotorWiring {
  uint16_t port, ddr;  // registers of the port with all its pins
  int forward_bit;     // high: forward
  int reverse_bit;  // second input of a TB6612 or L298N bridge; kNone: forward_bit alone sets the direction
  int brake_bit;    // kNone: no brake pin
};

struct EncoderWiring {
  char port;
  int a_bit, b_bit;
};

/// A switch to ground at a protecting input.
struct SwitchWiring {
  char port;
  int bit;
};

/// Pin assignment of a board, matching firmware/board/trex.hpp and nano.hpp. Pairs are left, right.
struct Wiring {
  static constexpr int kNone = -1;
  MotorWiring motor[2];
  EncoderWiring encoder[2];
  SwitchWiring input[2];
  int battery_channel, current_channel[2];  // the right one is the next after the left one
  int accelerometer_channel;                // of x; y and z are the next; kNone: no accelerometer
};

constexpr Wiring kTrexWiring = {
    {{reg::kPortD, reg::kDdrD, 2, Wiring::kNone, 4}, {reg::kPortB, reg::kDdrB, 2, Wiring::kNone, 1}},
    {{'D', 5, 6}, {'B', 4, 5}},
    {{'D', 7}, {'B', 0}},
    3,
    {6, 7},
    0};

constexpr Wiring kNanoWiring = {
    {{reg::kPortD, reg::kDdrD, 2, 4, Wiring::kNone}, {reg::kPortB, reg::kDdrB, 2, 4, Wiring::kNone}},
    {{'D', 5, 6}, {'B', 0, 1}},
    {{'C', 0}, {'C', 1}},
    3,
    {6, 7},
    Wiring::kNone};

/// Return the wiring by the board number of the protocol's `identity`; null if unknown.
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
