#pragma once
#include <avr/io.h>
#include <avr/pgmspace.h>

#include "core/gyro_heading.hpp"
#include "core/messages.hpp"

/// MPU-6050 on the TWI pins A4 (SDA) and A5 (SCL), 400 kHz: reads its yaw rate each millisecond.
///
/// Nothing here waits. A transfer is a chain of bytes, and the main loop takes one step whenever one is done.
/// If a transfer fails or shows no progress for some milliseconds, the device is missing. Then nine clock
/// pulses free the data line from a device that hangs in the middle of a byte, and everything starts again
/// after 0.2 s. This takes longer than a control tick, so telemetry shows each gap in the heading.
/// The pins stay untouched while the parameter `gyroscope` is 0.
class Mpu6050 {
 public:
  /// Make both pins inputs: a restart may come in the middle of a transfer.
  static void Start() {
    TWCR = 0;
    DDRC &= static_cast<uint8_t>(~(1 << PC5));
  }

  /// True if Step() is due. Then the main loop must not sleep.
  bool due() const { return busy_ != 0 && (TWCR & 1 << TWINT) != 0; }

  /// Take the next step of the transfer. stationary: the motors are off and the wheels do not turn.
  __attribute__((noinline)) void Step(bool stationary) {
    wait_ = kStuck_ms;
    switch (TWSR) {  // the prescaler bits are zero
      case kStarted:
        Send(kAddress << 1);
        break;
      case kRestarted:
        Send(kAddress << 1 | 1);
        break;
      case kAddressed:
        Send(Setting(0));
        break;
      case kSent:
        if (reads()) {
          TWCR = kNext | 1 << TWSTA;
        } else if (!value_sent_) {
          value_sent_ = true;
          Send(Setting(1));
        } else {
          Finish();
          wait_ = kSettle_ms;
          ++phase_;
        }
        break;
      case kAddressedToRead:
        TWCR = kNext | 1 << TWEA;  // one more byte follows the next one
        break;
      case kReceived:
        high_ = TWDR;
        TWCR = kNext;
        break;
      case kReceivedLast:
        Take(stationary);
        break;
      default:  // no answer, or a disturbed bus
        Miss();
    }
  }

  /// Start the next transfer. Call when milliseconds have passed. mode: the parameter `gyroscope`.
  __attribute__((noinline)) void AfterMilliseconds(uint8_t elapsed_ms, uint8_t mode) {
    if (mode != mode_) Miss();
    mode_ = mode;
    if (mode == 0) return;
    if (phase_ == kMeasure) heading_.Advance(elapsed_ms);
    if (phase_ == kMissing && wait_ > kRetry_ms - 2 * kPulses) DDRC ^= 1 << PC5;  // low, released, low ...
    if (--wait_ != 0) return;
    if (busy_ != 0) {
      Miss();  // no progress
      return;
    }
    if (phase_ == kMissing) ++phase_;
    busy_ = wait_ = kStuck_ms;
    value_sent_ = false;
    TWBR = (F_CPU / kClock_Hz - 16) / 2;
    TWCR = kNext | 1 << TWSTA;
  }

  /// Complete body of the naked interrupt, 17 cycles: it only wakes the main loop. The transfer waits with
  /// its flag set. These instructions change no processor flag.
  __attribute__((always_inline)) static void OnDone() {
    __asm__ volatile(
        "push r24\n\t"
        "ldi r24, %[on]\n\t"
        "sts %[control], r24\n\t"
        "pop r24\n\t"
        "reti"
        :
        : [control] "i"(_SFR_MEM_ADDR(TWCR)), [on] "M"(1 << TWEN)
        : "memory");
  }

  /// [rev/65536], counter-clockwise.
  uint16_t heading() const {
    const uint16_t heading = heading_.heading();
    return mode_ == kUpsideDown ? static_cast<uint16_t>(-heading) : heading;
  }
  fw::GyroscopeState state() const {
    return mode_ == 0              ? fw::GyroscopeState::kOff
           : phase_ != kMeasure    ? fw::GyroscopeState::kMissing
           : heading_.calibrated() ? fw::GyroscopeState::kReady
                                   : fw::GyroscopeState::kCalibrating;
  }

 private:
  enum Phase : uint8_t { kMissing, kIdentify, kWake, kFilter, kScale, kBegin, kMeasure };

  static constexpr uint8_t kAddress = 0x68;
  static constexpr uint32_t kClock_Hz = 400000;
  static constexpr uint8_t kNext = 1 << TWINT | 1 << TWEN | 1 << TWIE;
  static constexpr uint8_t kPulses = 9;
  static constexpr uint8_t kRetry_ms = 200, kSettle_ms = 50, kStuck_ms = 5;
  static constexpr uint8_t kUpsideDown = 2;
  // Status codes of a master (ATmega328P data sheet, tables 22-2 and 22-3).
  static constexpr uint8_t kStarted = 0x08, kRestarted = 0x10, kAddressed = 0x18, kSent = 0x28,
                           kAddressedToRead = 0x40, kReceived = 0x50, kReceivedLast = 0x58;

  bool reads() const { return phase_ == kIdentify || phase_ >= kBegin; }

  /// Register of this phase's transfer, and the value that a phase without a reading writes.
  __attribute__((noinline)) uint8_t Setting(uint8_t part) const {
    static const uint8_t kSettings[] PROGMEM = {
        0x75, 0,     // WHO_AM_I
        0x6B, 1,     // PWR_MGMT_1: awake, clock of the X gyroscope
        0x1A, 2,     // CONFIG: 98 Hz, delays by 2.8 ms
        0x1B, 0x10,  // GYRO_CONFIG: +-1000 deg/s
        0x47, 0,     // GYRO_ZOUT_H, GYRO_ZOUT_L, for the first time
        0x47, 0,     // and again
    };
    return pgm_read_byte(&kSettings[2 * (phase_ - kIdentify) + part]);
  }

  __attribute__((noinline)) static void Send(uint8_t byte) {
    TWDR = byte;
    TWCR = kNext;
  }

  /// The two bytes of a reading are complete.
  void Take(bool stationary) {
    const uint8_t low = TWDR;
    Finish();
    if (phase_ >= kBegin) {
      const int16_t rate = static_cast<int16_t>(static_cast<uint16_t>(high_) << 8 | low);
      if (!heading_.Measure(rate, stationary)) {
        Miss();  // the device does not measure
        return;
      }
      phase_ = kMeasure;
    } else if (high_ == kAddress) {
      ++phase_;
    } else {
      Miss();  // another device has this address
    }
  }

  void Finish() {
    TWCR = 1 << TWINT | 1 << TWEN | 1 << TWSTO;
    busy_ = 0;
    wait_ = 1;
  }

  __attribute__((noinline)) void Miss() {
    Start();
    busy_ = 0;
    phase_ = kMissing;
    wait_ = kRetry_ms;
  }

  fw::GyroHeading heading_;
  uint8_t mode_ = 0, phase_ = kMissing, wait_ = 0, high_ = 0;
  uint8_t busy_ = 0;  // not 0 while a transfer runs
  bool value_sent_ = false;
};
