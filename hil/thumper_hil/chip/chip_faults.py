"""Inject faults into the simulated chip: wires, motors, wheels, battery, serial line, firmware."""

from dataclasses import dataclass
from enum import IntEnum

from thumper_hil.chip.instrumented_chip import InstrumentedChip


class WireFault(IntEnum):
    """Fault of an encoder wire (thumper::WireFault). A cut wire reads high because of the pull-up."""

    OK = 0
    CUT = 1
    GROUNDED = 2
    STUCK = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class SideFaults:
    """Faults of the wheels and motors of one side (thumper::SideFaults)."""

    connected: float = 1.0  # share of the side's motors that are connected
    slip: float = 0.0  # share of the wheel travel that is lost to slip
    blocked: bool = False  # the wheels are jammed
    reversed: bool = False  # the motor leads are swapped
    shorted: bool = False  # the motor leads are shorted
    friction: float = 1.0  # of wheels and gears, relative to a healthy side


class FaultyChip(InstrumentedChip):
    """A chip whose robot can be broken on demand. Sides: 0 left, 1 right. Faults act at once."""

    def set_side_faults(self, side: int, faults: SideFaults) -> None:
        """Set the faults of the wheels and motors of one side."""
        self._library.thumper_side_faults(
            self._handle,
            side,
            faults.connected,
            faults.slip,
            faults.blocked,
            faults.reversed,
            faults.shorted,
            faults.friction,
        )

    def set_wire_fault(self, side: int, channel: int, fault: WireFault) -> None:
        """Set the fault of an encoder wire: channel 0 is A, 1 is B."""
        self._library.thumper_wire_fault(self._handle, side, channel, fault)

    def swap_channels(self, side: int, *, swapped: bool) -> None:
        """Swap channels A and B of an encoder, or undo the swap."""
        self._library.thumper_swap_channels(self._handle, side, swapped)

    def set_glitches(self, side: int, per_s: float) -> None:
        """Inject random short pulses on both channels of an encoder, `per_s` pulses per second."""
        self._library.thumper_glitches(self._handle, side, per_s)

    def set_switch(self, number: int, *, closed: bool) -> None:
        """Close or open the switch to ground at protecting input 1 or 2."""
        self._library.thumper_set_switch(self._handle, number - 1, closed)

    def set_battery(self, *, charge: float = -1.0, resistance_Ohm: float = -1.0) -> None:
        """Set the battery's charge (0...1) or inner resistance; negative values change nothing."""
        self._library.thumper_set_battery(self._handle, charge, resistance_Ohm)

    def stop_adc(self, *, stopped: bool) -> None:
        """Let no analogue conversion finish, or let them finish again."""
        self._library.thumper_stop_adc(self._handle, stopped)

    def power_gyroscope(self, *, on: bool) -> None:
        """Cut the gyroscope's power, or restore it: then it sleeps, with its registers reset."""
        self._library.thumper_power_gyroscope(self._handle, on)

    def freeze_gyroscope(self, *, frozen: bool) -> None:
        """Let the gyroscope answer with its last reading for ever, or measure again."""
        self._library.thumper_freeze_gyroscope(self._handle, frozen)

    def hold_twi_data(self, *, pulses: int) -> None:
        """Let the gyroscope hold SDA low for `pulses` clock pulses; -1: for ever, 0: let it go."""
        self._library.thumper_hold_twi_data(self._handle, pulses)

    def hold_twi_clock(self, *, held: bool) -> None:
        """Let the gyroscope hold SCL low, or let it go."""
        self._library.thumper_hold_twi_clock(self._handle, int(held))

    def move_currents(self, *, left_channel: int) -> None:
        """Connect the current sensors to this ADC channel and the next one; the old ones read zero."""
        self._library.thumper_move_currents(self._handle, left_channel)

    def set_line_noise(self, *, loss: float, flip: float) -> None:
        """Set the share of bytes, in both directions, that get lost and that get one bit flipped."""
        self._library.thumper_line_noise(self._handle, loss, flip)

    def hang(self, *, interrupts_off: bool) -> None:
        """Put the firmware into an endless loop."""
        self._library.thumper_hang(self._handle, interrupts_off)
