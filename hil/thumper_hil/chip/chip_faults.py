"""The simulated chip with what can go wrong round it: wires, motors, wheels, battery, line, program."""

from dataclasses import dataclass
from enum import IntEnum

from thumper_hil.chip.instrumented_chip import InstrumentedChip


class WireFault(IntEnum):
    """What is wrong with an encoder's wire (thumper::WireFault): pulled up, a cut one is high."""

    OK = 0
    CUT = 1
    GROUNDED = 2
    STUCK = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class SideFaults:
    """What is wrong with the wheels and motors of one side (thumper::SideFaults)."""

    connected: float = 1.0  # share of the side's motors whose wires are whole
    slip: float = 0.0  # share of the wheels' travel that the floor does not get
    blocked: bool = False  # the wheels are jammed
    reversed: bool = False  # the motors' two wires are exchanged
    shorted: bool = False  # the wires touch


class FaultyChip(InstrumentedChip):
    """The chip of a robot that breaks on demand. Sides are 0 left, 1 right; all acts from now on."""

    def set_side_faults(self, side: int, faults: SideFaults) -> None:
        """Break or mend the wheels and motors of one side."""
        self._library.thumper_side_faults(
            self._handle,
            side,
            faults.connected,
            faults.slip,
            faults.blocked,
            faults.reversed,
            faults.shorted,
        )

    def set_wire_fault(self, side: int, channel: int, fault: WireFault) -> None:
        """Break or mend a wire of an encoder: channel 0 is A, 1 is B."""
        self._library.thumper_wire_fault(self._handle, side, channel, fault)

    def swap_channels(self, side: int, *, swapped: bool) -> None:
        """Exchange channels A and B of an encoder, or put them right."""
        self._library.thumper_swap_channels(self._handle, side, swapped)

    def set_glitches(self, side: int, per_s: float) -> None:
        """Let so many short pulses a second come over either channel of an encoder, at random."""
        self._library.thumper_glitches(self._handle, side, per_s)

    def set_battery(self, *, charge: float = -1.0, resistance_Ohm: float = -1.0) -> None:
        """Give the battery another charge (0...1) or inner resistance; what is negative stays."""
        self._library.thumper_set_battery(self._handle, charge, resistance_Ohm)

    def set_line_noise(self, *, loss: float, flip: float) -> None:
        """Shares of the serial line's bytes, both ways, that vanish and that have a bit turned over."""
        self._library.thumper_line_noise(self._handle, loss, flip)

    def hang(self, *, interrupts_off: bool) -> None:
        """Let the program fall into an endless loop."""
        self._library.thumper_hang(self._handle, interrupts_off)
