#pragma once
#include "avr.hpp"
#include "mpu6050.hpp"
#include "plant.hpp"

namespace thumper {

/// The chip's two-wire interface as master, and its bus with an MPU-6050.
///
/// Replaces simavr's interface, which takes constant times and knows no bus that is busy. Timing: a bit is
/// `16 + 2 TWBR 4^TWPS` cycles, a byte nine bits (ATmega328P data sheet, 22.5.2). While the device holds the
/// data line low, no start condition completes; while it holds the clock low, nothing does. With the
/// interface off, clock pulses on the port's pin reach the device.
class TwiBus {
 public:
  TwiBus(avr_t* avr, const Plant* plant, uint64_t seed);
  TwiBus(const TwiBus&) = delete;
  TwiBus& operator=(const TwiBus&) = delete;

  void Rearm();  ///< after a reset of the chip
  Mpu6050& device() { return device_; }

 private:
  enum class Doing { kNothing, kStart, kAddress, kSend, kReceive };

  static void OnControl(avr_t* avr, avr_io_addr_t address, uint8_t value, void* self);
  static void OnStore(avr_t* avr, avr_io_addr_t address, uint8_t value, void* self);
  static void OnClockPin(avr_t* avr, avr_io_addr_t address, uint8_t value, void* self);
  static avr_cycle_count_t OnDone(avr_t* avr, avr_cycle_count_t when, void* self);

  void Begin(uint8_t control);
  void Schedule(int bits);
  void Finish(uint8_t status);
  uint64_t BitCycles() const;
  bool ClockIsLow() const;

  avr_t* avr_;
  avr_twi_t* twi_;
  const Plant* plant_;
  Mpu6050 device_;
  Doing doing_ = Doing::kNothing;
  bool owns_bus_ = false;  // between start and stop condition
  bool selected_ = false;  // the device has acknowledged its address
  bool expects_address_ = false, reads_ = false, clock_low_ = false;
};

}  // namespace thumper
