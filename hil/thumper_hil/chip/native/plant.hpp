#pragma once
#include "avr.hpp"
#include "bridge.hpp"
#include "drive_train.hpp"
#include "encoder.hpp"
#include "faults.hpp"
#include "mma7361.hpp"

namespace thumper {

/// The robot around the chip: bridges and encoders on the chip's pins, battery and currents on its ADC.
///
/// A cycle timer steps the drive train every millisecond, and a motor pin that changes steps it at once. Each
/// step is planned ahead with constant inputs, so every encoder edge has its own cycle and nothing runs
/// between events.
class Plant {
 public:
  Plant(avr_t* avr, const PlantParams& params, const Wiring& wiring, uint64_t seed);

  /// Restore levels and timers after a reset of the chip (simavr clears both).
  void Rearm();

  /// Return the voltage at an ADC channel: battery, motor currents and accelerometer, 0 on an
  /// unconnected channel.
  double AnalogIn_V(int channel) const;

  /// Return the true duration of this many cycles: the chip's clock may run fast or slow.
  double Seconds(uint64_t cycles) const { return static_cast<double>(cycles) / clock_Hz_; }

  /// Return the true state at this cycle.
  RobotState State() const;
  double YawRate() const;  ///< [rad/s], counter-clockwise, over the planned millisecond
  double battery_V() const { return drive_train_.battery().voltage_V(); }
  double charge() const { return drive_train_.battery().charge(); }

  void Place(double x_m, double y_m, double yaw_rad);
  void Hold(double v_m_s, double w_rad_s);  ///< see DriveTrain; the bumper, a switch at input 1, closes
  void Release();

  void SetClimb(double climb_rad);  ///< see DriveTrain

  /// Incline the body: `pitch` with the front down, `roll` with the right side down. Only the accelerometer
  /// notices.
  void SetAttitude(double pitch_rad, double roll_rad) { accelerometer_.SetAttitude(pitch_rad, roll_rad); }

  // Faults, effective immediately.
  void SetSideFaults(int side, const SideFaults& faults);
  void SetWireFault(int side, int channel, WireFault fault);  ///< channel 0 is A, 1 is B
  void SetChannelsSwapped(int side, bool swapped);
  void SetGlitches(int side, double per_s);               ///< random, on either channel of the encoder
  void SetSwitch(int input, bool closed);                 ///< at a protecting input, 0 or 1
  void SetBattery(double charge, double resistance_Ohm);  ///< negative: unchanged

  void MoveCurrents(int left_channel) { left_current_channel_ = left_channel; }  ///< the right one follows it

  int32_t encoder_count(int side) const { return encoder_[side].encoder.count(); }

 private:
  struct EncoderPins {
    Plant* plant;
    avr_ioport_t* port;
    int a_bit, b_bit;
    Encoder encoder;
    WireFault fault[2] = {WireFault::kNone, WireFault::kNone};
    bool swapped = false;      // channels A and B swapped
    double glitches_Hz = 0.0;  // rate of short pulses that the wires pick up
    int glitch_channel = kNoGlitch;
    Random glitch_random;
    static constexpr int kNoGlitch = -1;
  };

  static avr_cycle_count_t OnTick(avr_t* avr, avr_cycle_count_t when, void* self);
  static avr_cycle_count_t OnEdge(avr_t* avr, avr_cycle_count_t when, void* pins);
  static avr_cycle_count_t OnGlitch(avr_t* avr, avr_cycle_count_t when, void* pins);
  static void OnMotorPin(avr_irq_t* irq, uint32_t value, void* self);

  EncoderPins Wire(int side, uint64_t seed);
  void PlanTo(uint64_t end_cycle);
  void ScheduleEdge(EncoderPins& pins);
  static void ScheduleGlitch(EncoderPins& pins);
  static void DriveBoth(EncoderPins& pins);
  void DriveSwitches();
  static void DriveWire(EncoderPins& pins, int channel, int bit, bool level);

  avr_t* avr_;
  PlantParams params_;
  const Wiring& wiring_;
  double clock_Hz_;  // true cycles per second
  BridgePins bridges_;
  DriveTrain drive_train_;
  Random random_;
  EncoderPins encoder_[2];
  bool closed_[2] = {false, false};  // switches at the protecting inputs
  int left_current_channel_;
  Mma7361 accelerometer_;
  bool touches_ = false;  // the bumper closes the first one, too
  BridgeCommand command_[2];
  uint64_t planned_to_;    // end of the step that `drive_train_` has already taken
  uint64_t planned_from_;  // start of that step
  DriveTrain before_;      // drive train at that start, to repeat the step if a pin changes during it
};

}  // namespace thumper
