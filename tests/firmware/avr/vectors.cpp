// Runs the shared vectors on the chip. Every result is written to TWAMR, byte by byte; then the chip sleeps
// for ever.

#include "native/vectors.hpp"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

namespace {
struct Register {
  void Put(int32_t word) {
    for (uint8_t i = 0; i < 4; ++i) TWAMR = static_cast<uint8_t>(static_cast<uint32_t>(word) >> (8 * i));
  }
};
}  // namespace

int main() {
  Register sink;
  vectors::Run(sink);
  cli();
  sleep_enable();
  sleep_cpu();
}
