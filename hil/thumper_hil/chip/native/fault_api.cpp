// C interface of the faults for chip_faults.py. It lets no exception through.
#include "chip.hpp"

using thumper::Chip;
using thumper::WireFault;

extern "C" {

void thumper_side_faults(Chip* chip, int side, double connected, double slip, int blocked, int reversed,
                         int shorted, double friction) {
  chip->plant()->SetSideFaults(side, {connected, slip, blocked != 0, reversed != 0, shorted != 0, friction});
}
void thumper_wire_fault(Chip* chip, int side, int channel, int fault) {
  chip->plant()->SetWireFault(side, channel, static_cast<WireFault>(fault));
}
void thumper_swap_channels(Chip* chip, int side, int swapped) {
  chip->plant()->SetChannelsSwapped(side, swapped != 0);
}
void thumper_glitches(Chip* chip, int side, double per_s) { chip->plant()->SetGlitches(side, per_s); }
void thumper_set_switch(Chip* chip, int input, int closed) { chip->plant()->SetSwitch(input, closed != 0); }
void thumper_set_battery(Chip* chip, double charge, double resistance_Ohm) {
  chip->plant()->SetBattery(charge, resistance_Ohm);
}
void thumper_stop_adc(Chip* chip, int stopped) { chip->adc()->SetStopped(stopped != 0); }
void thumper_fit_gyroscope(Chip* chip, double bias_deg_s, int upside_down, int identity) {
  chip->twi().device().Fit(bias_deg_s, upside_down != 0, static_cast<uint8_t>(identity));
}
void thumper_power_gyroscope(Chip* chip, int on) { chip->twi().device().SetPower(on != 0); }
void thumper_freeze_gyroscope(Chip* chip, int frozen) { chip->twi().device().SetFrozen(frozen != 0); }
void thumper_hold_twi_data(Chip* chip, int pulses) { chip->twi().device().HoldData(pulses); }

void thumper_hold_twi_clock(Chip* chip, int held) { chip->twi().device().HoldClock(held != 0); }
void thumper_move_currents(Chip* chip, int left_channel) { chip->plant()->MoveCurrents(left_channel); }
void thumper_line_noise(Chip* chip, double loss, double flip) { chip->uart().SetNoise(loss, flip); }
void thumper_hang(Chip* chip, int interrupts_off) { chip->Hang(interrupts_off != 0); }

}  // extern "C"
