#include "twi_bus.hpp"

namespace thumper {
namespace {

constexpr uint8_t kInt = 0x80, kAck = 0x40, kSta = 0x20, kSto = 0x10, kEnable = 0x04;  // TWCR
constexpr int kClockBit = 5;                                                           // PC5

}  // namespace

TwiBus::TwiBus(avr_t* avr, const Plant* plant, uint64_t seed)
    : avr_(avr), twi_(FindPeripheral<avr_twi_t>(avr, "twi")), plant_(plant), device_(seed) {
  const auto replace = [this](uint16_t address, avr_io_write_t write) {
    avr_->io[AVR_DATA_TO_IO(address)].w.c = write;
    avr_->io[AVR_DATA_TO_IO(address)].w.param = this;
  };
  replace(reg::kTwcr, OnControl);
  replace(reg::kTwdr, OnStore);
  replace(reg::kTwsr, OnStore);
  replace(reg::kTwbr, OnStore);
  twi_->twi.raise_sticky = 1;  // only the program clears the flag
  avr_register_io_write(avr_, reg::kDdrC, OnClockPin, this);
  Rearm();
}

void TwiBus::Rearm() {
  avr_cycle_timer_cancel(avr_, OnDone, this);
  doing_ = Doing::kNothing;
  owns_bus_ = selected_ = clock_low_ = false;
  avr_->data[reg::kTwcr] = 0;
  avr_->data[reg::kTwsr] = 0xF8;
}

void TwiBus::OnStore(avr_t* avr, avr_io_addr_t address, uint8_t value, void*) { avr->data[address] = value; }

void TwiBus::OnControl(avr_t* avr, avr_io_addr_t, uint8_t value, void* self) {
  TwiBus* bus = static_cast<TwiBus*>(self);
  uint8_t& control = avr->data[reg::kTwcr];
  if ((value & kEnable) == 0) {
    avr_clear_interrupt(avr, &bus->twi_->twi);
    bus->Rearm();
    control = value & static_cast<uint8_t>(~kInt);
    return;
  }
  if ((value & kInt) == 0) {  // the flag stays as it is
    const bool raised = (control & kInt) != 0;
    control = static_cast<uint8_t>(value | (control & kInt));
    if (raised && !bus->twi_->twi.pending) avr_raise_interrupt(avr, &bus->twi_->twi);
    return;
  }
  avr_clear_interrupt(avr, &bus->twi_->twi);
  control = value & static_cast<uint8_t>(~kInt);
  bus->Begin(value);
}

void TwiBus::Begin(uint8_t control) {
  if ((control & kSto) != 0) {
    owns_bus_ = selected_ = false;
    avr_->data[reg::kTwcr] &= static_cast<uint8_t>(~kSto);  // it takes a bit, but nothing waits for it
  }
  if ((control & kSta) != 0) {
    doing_ = Doing::kStart;
    Schedule(owns_bus_ ? 2 : 1);
  } else if (owns_bus_ && expects_address_) {
    doing_ = Doing::kAddress;
    Schedule(9);
  } else if (owns_bus_) {
    doing_ = reads_ ? Doing::kReceive : Doing::kSend;
    Schedule(9);
  }
}

avr_cycle_count_t TwiBus::OnDone(avr_t* avr, avr_cycle_count_t when, void* self) {
  TwiBus* bus = static_cast<TwiBus*>(self);
  uint8_t& data = avr->data[reg::kTwdr];
  const uint8_t control = avr->data[reg::kTwcr];
  if (bus->device_.holds_clock()) return when + bus->BitCycles();
  switch (bus->doing_) {
    case Doing::kStart: {
      if (bus->device_.holds_data()) return when + bus->BitCycles();  // the bus is not free
      const uint8_t status = bus->owns_bus_ ? 0x10 : 0x08;
      if (!bus->owns_bus_) {
        if (bus->plant_ != nullptr) bus->device_.SetRate(bus->plant_->YawRate());
        bus->device_.Start(static_cast<double>(avr->cycle) / kCpuHz);
      }
      bus->owns_bus_ = bus->expects_address_ = true;
      bus->Finish(status);
      break;
    }
    case Doing::kAddress: {
      bus->selected_ = bus->device_.Select(data);
      bus->reads_ = (data & 1) != 0;
      bus->expects_address_ = false;
      const uint8_t acknowledged = bus->reads_ ? 0x40 : 0x18;
      bus->Finish(static_cast<uint8_t>(bus->selected_ ? acknowledged : acknowledged + 8));
      break;
    }
    case Doing::kSend:
      if (bus->selected_) bus->device_.Write(data);
      bus->Finish(bus->selected_ ? 0x28 : 0x30);
      break;
    case Doing::kReceive:
      data = bus->device_.holds_data() ? 0x00 : bus->selected_ ? bus->device_.Read() : 0xFF;
      bus->Finish((control & kAck) != 0 ? 0x50 : 0x58);
      break;
    case Doing::kNothing:
      break;
  }
  return 0;
}

void TwiBus::Finish(uint8_t status) {
  doing_ = Doing::kNothing;
  avr_->data[reg::kTwsr] = static_cast<uint8_t>(status | (avr_->data[reg::kTwsr] & 3));
  avr_raise_interrupt(avr_, &twi_->twi);
}

void TwiBus::Schedule(int bits) {
  avr_cycle_timer_register(avr_, static_cast<uint64_t>(bits) * BitCycles(), OnDone, this);
}

uint64_t TwiBus::BitCycles() const {
  const unsigned prescaler = avr_->data[reg::kTwsr] & 3u;
  return 16 + (2ull * avr_->data[reg::kTwbr] << (2 * prescaler));
}

/// The port drives the clock line only while the interface is off.
bool TwiBus::ClockIsLow() const {
  const bool drives_low =
      (avr_->data[reg::kDdrC] >> kClockBit & 1) != 0 && (avr_->data[reg::kPortC] >> kClockBit & 1) == 0;
  return drives_low && (avr_->data[reg::kTwcr] & kEnable) == 0;
}

void TwiBus::OnClockPin(avr_t*, avr_io_addr_t, uint8_t, void* self) {
  TwiBus* bus = static_cast<TwiBus*>(self);
  const bool low = bus->ClockIsLow();
  if (bus->clock_low_ && !low && !bus->device_.holds_clock()) bus->device_.ClockPulse();
  bus->clock_low_ = low;
}

}  // namespace thumper
