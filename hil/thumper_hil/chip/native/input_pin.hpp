#pragma once
#include "avr.hpp"

namespace thumper {

/// Set an input's level so that it stays. simavr raises pulled-up inputs again on every write to their port,
/// unless the port stores the level as external. After a reset it forgets the level, but not that it has
/// reported it.
inline void DriveInput(avr_ioport_t* port, int bit, bool level) {
  const unsigned mask = 1u << bit;
  port->external.pull_value =
      static_cast<uint8_t>(level ? port->external.pull_value | mask : port->external.pull_value & ~mask);
  avr_raise_irq(port->io.irq + IOPORT_IRQ_PIN0 + bit, level);
  uint8_t& pin = port->io.avr->data[port->r_pin];
  pin = static_cast<uint8_t>(level ? pin | mask : pin & ~mask);
}

}  // namespace thumper
