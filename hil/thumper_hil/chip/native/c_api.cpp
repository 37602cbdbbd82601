// C interface of the library for ctypes (chip.py). It lets no exception through.
#include <cstdio>
#include <exception>

#include "chip.hpp"

using thumper::Chip;
using thumper::PlantParams;
using thumper::RobotState;

extern "C" {

/// True state of the robot, all doubles: time [s], pose, then for each side travel, speed, current and
/// encoder count, then battery [V] and state of charge.
struct ThumperTruth {
  double time_s, x_m, y_m, yaw_rad;
  double wheel_rad[2], wheel_rad_s[2], current_A[2], encoder_count[2];
  double battery_V, charge;
};

/// `params` is null for a bare chip. `board` is the board number of the protocol's identity. Return null and
/// fill `error` on failure.
Chip* thumper_open(const char* elf_path, const double* params, size_t param_count, int board, uint64_t seed,
                   char* error, size_t error_size) {
  const thumper::Wiring* wiring = thumper::FindWiring(board);
  if (wiring == nullptr) {
    std::snprintf(error, error_size, "unknown board %d; add its wiring to wiring.hpp", board);
    return nullptr;
  }
  if (params != nullptr && param_count != thumper::kPlantParamCount) {
    std::snprintf(error, error_size, "the library takes %zu plant parameters, got %zu; rebuild it",
                  thumper::kPlantParamCount, param_count);
    return nullptr;
  }
  try {
    PlantParams plant{};
    if (params != nullptr) std::memcpy(&plant, params, sizeof plant);
    return new Chip(elf_path, params != nullptr ? &plant : nullptr, *wiring, seed);
  } catch (const std::exception& exception) {
    std::snprintf(error, error_size, "%s", exception.what());
    return nullptr;
  }
}

void thumper_close(Chip* chip) { delete chip; }

int thumper_run(Chip* chip, uint64_t until_cycle, size_t bytes_wanted) {
  return static_cast<int>(chip->Run(until_cycle, bytes_wanted));
}

uint64_t thumper_cycle(const Chip* chip) { return chip->cycle(); }
uint64_t thumper_resets(const Chip* chip) { return chip->resets(); }
uint64_t thumper_slept_cycles(const Chip* chip) { return chip->slept_cycles(); }
uint64_t thumper_overruns(Chip* chip) { return chip->uart().overruns(); }
uint8_t thumper_data(const Chip* chip, uint16_t address) { return chip->data(address); }
void thumper_reset(Chip* chip) { chip->Reset(); }
uint32_t thumper_program_counter(const Chip* chip) { return chip->program_counter(); }

void thumper_set_host_baud(Chip* chip, uint32_t baud) { chip->uart().SetHostBaud(baud); }
void thumper_send(Chip* chip, const uint8_t* data, size_t count) { chip->uart().Send(data, count); }
size_t thumper_available(Chip* chip) { return chip->uart().Available(); }
size_t thumper_receive(Chip* chip, uint8_t* data, uint64_t* cycles, size_t capacity) {
  return chip->uart().Receive(data, cycles, capacity);
}

void thumper_truth(Chip* chip, ThumperTruth* truth) {
  const thumper::Plant& plant = *chip->plant();
  const RobotState state = plant.State();
  truth->time_s = plant.Seconds(chip->cycle());
  truth->x_m = state.x_m;
  truth->y_m = state.y_m;
  truth->yaw_rad = state.yaw_rad;
  for (int side = 0; side < 2; ++side) {
    truth->wheel_rad[side] = state.wheel_rad[side];
    truth->wheel_rad_s[side] = state.wheel_rad_s[side];
    truth->current_A[side] = state.current_A[side];
    truth->encoder_count[side] = plant.encoder_count(side);
  }
  truth->battery_V = plant.battery_V();
  truth->charge = plant.charge();
}

void thumper_place(Chip* chip, double x_m, double y_m, double yaw_rad) {
  chip->plant()->Place(x_m, y_m, yaw_rad);
}
void thumper_hold(Chip* chip, double v_m_s, double w_rad_s) { chip->plant()->Hold(v_m_s, w_rad_s); }
void thumper_set_attitude(Chip* chip, double pitch_rad, double roll_rad) {
  chip->plant()->SetAttitude(pitch_rad, roll_rad);
}
void thumper_set_climb(Chip* chip, double climb_rad) { chip->plant()->SetClimb(climb_rad); }
void thumper_release(Chip* chip) { chip->plant()->Release(); }

}  // extern "C"
