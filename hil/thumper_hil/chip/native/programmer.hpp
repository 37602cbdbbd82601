#pragma once
#include <cstddef>
#include <cstdint>

#include "avr.hpp"

namespace thumper {

/// External programmer of a chip: its flash, its EEPROM and the fuses that select the start address.
class Programmer {
 public:
  explicit Programmer(avr_t* avr) : avr_(avr) {}

  /// Return false if the data does not fit.
  bool WriteFlash(uint32_t address, const uint8_t* data, std::size_t count) {
    if (address > avr_->flashend + 1 || count > avr_->flashend + 1 - address) return false;
    std::memcpy(avr_->flash + address, data, count);
    avr_->codeend = avr_->flashend;
    return true;
  }

  bool ReadFlash(uint32_t address, uint8_t* data, std::size_t count) const {
    if (address > avr_->flashend + 1 || count > avr_->flashend + 1 - address) return false;
    std::memcpy(data, avr_->flash + address, count);
    return true;
  }

  bool WriteEeprom(uint32_t address, const uint8_t* data, std::size_t count) {
    const avr_eeprom_t* eeprom = FindPeripheral<avr_eeprom_t>(avr_, "eeprom");
    if (address > eeprom->size || count > eeprom->size - address) return false;
    std::memcpy(eeprom->eeprom + address, data, count);
    return true;
  }

  bool ReadEeprom(uint32_t address, uint8_t* data, std::size_t count) const {
    const avr_eeprom_t* eeprom = FindPeripheral<avr_eeprom_t>(avr_, "eeprom");
    if (address > eeprom->size || count > eeprom->size - address) return false;
    std::memcpy(data, eeprom->eeprom + address, count);
    return true;
  }

  /// Set the start address after a reset [bytes], as the fuses BOOTRST and BOOTSZ do.
  void StartAt(uint32_t address) { avr_->reset_pc = address; }

 private:
  avr_t* avr_;
};

}  // namespace thumper
