// Executes an invalid opcode.
#include "bench.h"

int main(void) { asm volatile(".word 0x0001"); }
