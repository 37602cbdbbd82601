// Sleeps with interrupts off, so nothing can wake it.
#include "bench.h"

int main(void) {
  cli();
  sleep_mode();
}
