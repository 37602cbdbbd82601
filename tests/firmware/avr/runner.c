// Runs an ELF on the emulated ATmega328P until it sleeps for ever, and copies everything it writes to TWAMR
// to stdout. (The firmware itself uses the general purpose registers.)

#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <simavr/sim_io.h>
#include <stdio.h>
#include <string.h>

static const avr_io_addr_t kTwamr = 0xBD;  // data-space address
static const avr_cycle_count_t kLimit = 400000000;

static void OnWrite(struct avr_t* avr, avr_io_addr_t address, uint8_t value, void* out) {
  avr->data[address] = value;
  fputc(value, out);
}

static void Silent(avr_t* avr, const int level, const char* format, va_list arguments) {
  (void)avr, (void)level, (void)format, (void)arguments;
}

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  avr_global_logger_set(Silent);
  elf_firmware_t firmware;
  memset(&firmware, 0, sizeof(firmware));
  if (elf_read_firmware(argv[1], &firmware) != 0) return 3;
  avr_t* avr = avr_make_mcu_by_name("atmega328p");
  if (avr == NULL) return 4;
  avr_init(avr);
  avr_load_firmware(avr, &firmware);
  avr->frequency = 16000000;
  avr_register_io_write(avr, kTwamr, OnWrite, stdout);
  int state = cpu_Running;
  while (state != cpu_Done && state != cpu_Crashed && avr->cycle < kLimit) state = avr_run(avr);
  fprintf(stderr, "%llu cycles\n", (unsigned long long)avr->cycle);
  return state == cpu_Done ? 0 : 5;
}
