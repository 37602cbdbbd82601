// Runs into something that is no instruction.
#include "bench.h"

int main(void) { asm volatile(".word 0x0001"); }
