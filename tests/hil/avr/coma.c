// Sleeps with interrupts off: nothing can wake it.
#include "bench.h"

int main(void) {
  cli();
  sleep_mode();
}
