"""All faults by name, with the values that each accepts."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from thumper.common.geometry import Pose2
from thumper_hil.chip.chip_faults import WireFault
from thumper_hil.faults.switches import CHANNELS, DEVICES, SIDES, Switches

DRAGGING = 2.5  # friction of a side with a dragging wheel, relative to a healthy one
FaultValue = str | float | list[float]


class FaultError(ValueError):
    """Unknown fault or invalid value; the caller adds where it was read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """A fault whose value is one of several words."""

    actions: Mapping[str, Callable[[Switches], None]]

    def action(self, value: object) -> Callable[[Switches], None]:
        """Return the action for this word."""
        if not isinstance(value, str) or value not in self.actions:
            raise FaultError(f"{value!r}: must be {' or '.join(self.actions)}")
        return self.actions[value]

    def persists(self, value: object) -> bool:
        """Return True if this value causes a fault that lasts until the next value."""
        return "ok" in self.actions and value != "ok"


@dataclass(frozen=True, slots=True, kw_only=True)
class Amount:
    """A fault whose value is a number from 0 to `maximum`."""

    apply: Callable[[Switches, float], None]
    unit: str
    maximum: float
    normal: float | None = 0.0  # the value without a fault; None: every value counts as a fault
    is_transient: bool = False  # the fault ends by itself

    def action(self, value: object) -> Callable[[Switches], None]:
        """Return the action for this number."""
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= self.maximum:
            raise FaultError(f"{value!r}: must be a number, 0...{self.maximum:g} {self.unit}".rstrip())
        amount = float(value)
        return lambda switches: self.apply(switches, amount)

    def persists(self, value: object) -> bool:
        """Return True if this value causes a fault that lasts until the next value."""
        return not self.is_transient and value != self.normal


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseFault:
    """A fault whose value is a pose, to which the robot is carried: x [m], y [m], heading [deg]."""

    def action(self, value: object) -> Callable[[Switches], None]:
        """Return the action that moves the robot there."""
        if not isinstance(value, list | tuple) or len(value) != 3 or not all(map(_finite, value)):
            raise FaultError(f"{value!r}: must be [x_m, y_m, heading_deg]")
        x_m, y_m, heading_deg = value
        pose = Pose2(x_m=float(x_m), y_m=float(y_m), theta_rad=math.radians(heading_deg))
        return lambda switches: switches.chip.place(pose)

    def persists(self, _value: object) -> bool:
        """Return False: moving the robot is a single event."""
        return False


def effect_of(name: str) -> str:
    """Return what a fault does, in a few words."""
    return EFFECTS[".".join(part for part in name.split(".") if part not in SIDES)]


def title_of(name: str) -> str:
    """Return a fault's name in words, as "Left encoder: wire A"."""
    sides = [part for part in name.split(".") if part in SIDES]
    title = TITLES[".".join(part for part in name.split(".") if part not in SIDES)]
    text = " ".join([*sides, title])
    return text[0].upper() + text[1:]


def fault_action(name: str, value: object) -> Callable[[Switches], None]:
    """Return the action of a fault on a bench; raise FaultError for an unknown name or invalid value."""
    if name not in FAULTS:
        raise FaultError(f"unknown fault {name!r}; choose from {', '.join(FAULTS)}")
    try:
        return FAULTS[name].action(value)
    except FaultError as error:
        raise FaultError(f"{name} = {error}") from None


def _finite(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _wire(side: int, channel: int) -> Choice:
    def set_fault(fault: WireFault) -> Callable[[Switches], None]:
        return lambda switches: switches.chip.set_wire_fault(side, channel, fault)

    return Choice(actions={fault.name.lower(): set_fault(fault) for fault in WireFault})


def _motor(side: int) -> Choice:
    return Choice(
        actions={
            "ok": lambda switches: switches.change_side(side, connected=1.0, reversed=False, shorted=False),
            "dead": lambda switches: switches.change_side(side, connected=0.0),
            "swapped": lambda switches: switches.change_side(side, reversed=True),
            "shorted": lambda switches: switches.change_side(side, shorted=True),
        }
    )


def _wheels(side: int) -> Choice:
    return Choice(
        actions={
            "ok": lambda switches: switches.change_side(side, blocked=False, friction=1.0),
            "dragging": lambda switches: switches.change_side(side, friction=DRAGGING),
            "blocked": lambda switches: switches.change_side(side, blocked=True),
        }
    )


def _channels(side: int) -> Choice:
    return Choice(
        actions={
            "ok": lambda switches: switches.chip.swap_channels(side, swapped=False),
            "swapped": lambda switches: switches.chip.swap_channels(side, swapped=True),
        }
    )


def _input(number: int) -> Choice:
    return Choice(
        actions={
            "ok": lambda switches: switches.chip.set_switch(number, closed=False),
            "closed": lambda switches: switches.chip.set_switch(number, closed=True),
        }
    )


def _plug(device: str) -> Choice:
    return Choice(
        actions={
            "ok": lambda switches: switches.unplugged.discard(device),
            "unplugged": lambda switches: switches.unplugged.add(device),
        }
    )


def _glitches(side: int) -> Amount:
    return Amount(
        apply=lambda switches, per_s: switches.chip.set_glitches(side, per_s), unit="1/s", maximum=50_000.0
    )


def _slip(side: int) -> Amount:
    return Amount(apply=lambda switches, share: switches.change_side(side, slip=share), unit="", maximum=1.0)


def _hang_host(switches: Switches, duration_s: float) -> None:
    switches.host_hangs_until_s = switches.chip.time_s + duration_s


def _roll(switches: Switches, angle_deg: float) -> None:
    switches.roll_rad = math.radians(angle_deg)


FAULTS: dict[str, Choice | Amount | PoseFault] = {
    **{
        f"encoder.{side}.{channel}": _wire(SIDES[side], CHANNELS[channel])
        for side in SIDES
        for channel in CHANNELS
    },
    **{f"encoder.{side}.channels": _channels(SIDES[side]) for side in SIDES},
    **{f"encoder.{side}.glitches": _glitches(SIDES[side]) for side in SIDES},
    **{f"motor.{side}": _motor(SIDES[side]) for side in SIDES},
    **{f"wheels.{side}": _wheels(SIDES[side]) for side in SIDES},
    **{f"slip.{side}": _slip(SIDES[side]) for side in SIDES},
    **{f"input.{number}": _input(number) for number in (1, 2)},
    "battery.charge": Amount(
        apply=lambda switches, share: switches.chip.set_battery(charge=share),
        unit="",
        maximum=1.0,
        normal=None,
    ),
    "battery.resistance": Amount(
        apply=lambda switches, ohm: switches.chip.set_battery(resistance_Ohm=ohm),
        unit="Ohm",
        maximum=10.0,
        normal=None,
    ),
    "adc": Choice(
        actions={
            "ok": lambda switches: switches.chip.stop_adc(stopped=False),
            "stopped": lambda switches: switches.chip.stop_adc(stopped=True),
        }
    ),
    "line.loss": Amount(
        apply=lambda switches, share: switches.set_line(line_loss=share), unit="", maximum=1.0
    ),
    "line.noise": Amount(
        apply=lambda switches, share: switches.set_line(line_flip=share), unit="", maximum=1.0
    ),
    "host.hang": Amount(apply=_hang_host, unit="s", maximum=60.0, is_transient=True),
    "firmware": Choice(
        actions={
            "loop": lambda switches: switches.chip.hang(interrupts_off=False),
            "hang": lambda switches: switches.chip.hang(interrupts_off=True),
            "reset": lambda switches: switches.chip.reset(),
        }
    ),
    **{device: _plug(device) for device in DEVICES},
    "gps.sky": Choice(
        actions={
            "ok": lambda switches: setattr(switches, "sky_is_blocked", False),
            "blocked": lambda switches: setattr(switches, "sky_is_blocked", True),
        }
    ),
    "gps.offset": Amount(
        apply=lambda switches, offset_m: setattr(switches, "gps_offset_m", offset_m), unit="m", maximum=1000.0
    ),
    "robot.carried": PoseFault(),
    "robot.rolled": Amount(apply=_roll, unit="deg", maximum=180.0),
}

TITLES: dict[str, str] = {  # by name without the side
    "encoder.a": "encoder: wire A",
    "encoder.b": "encoder: wire B",
    "encoder.channels": "encoder: A and B exchanged",
    "encoder.glitches": "encoder: random pulses",
    "motor": "motor",
    "wheels": "wheels: friction",
    "slip": "wheels: slip",
    "input.1": "protecting switch at input 1",
    "input.2": "protecting switch at input 2",
    "battery.charge": "battery: charge",
    "battery.resistance": "battery: internal resistance",
    "adc": "battery: voltage and current not measured",
    "line.loss": "serial line: lost bytes",
    "line.noise": "serial line: wrong bits",
    "host.hang": "host hangs",
    "firmware": "firmware hangs or resets",
    "board": "board: plug",
    "lidar": "lidar: plug",
    "imu": "IMU: plug",
    "gps": "GPS: plug",
    "camera": "camera: plug",
    "gps.sky": "GPS: view of the sky",
    "gps.offset": "GPS: offset to the east",
    "robot.carried": "robot: carried away",
    "robot.rolled": "robot: rolled to its side",
}

EFFECTS: dict[str, str] = {  # by name without the side
    "encoder.a": "The input reads high (cut), low (grounded), or its last level (stuck).",
    "encoder.b": "The input reads high (cut), low (grounded), or its last level (stuck).",
    "encoder.channels": "Exchanges A and B: the encoder counts backwards.",
    "encoder.glitches": "Adds random pulses to the encoder's wires, so many per second.",
    "motor": "No current (dead), reversed wires (swapped), or 0.1 ohm across them (shorted).",
    "wheels": f"The wheels have {DRAGGING:g} times the friction (dragging), or are jammed (blocked).",
    "slip": "This share of the wheels' travel does not move the robot.",
    "input.1": "Closes the protecting switch to ground.",
    "input.2": "Closes the protecting switch to ground.",
    "battery.charge": "Sets the charge: 0 is empty, 1 is full.",
    "battery.resistance": "Sets the internal resistance of the battery.",
    "adc": "The board measures no voltage and no current any more.",
    "line.loss": "This share of the serial bytes is lost.",
    "line.noise": "This share of the serial bytes has a wrong bit.",
    "host.hang": "The host neither reads nor writes for this time; it ends by itself.",
    "firmware": "The firmware loops, hangs with interrupts off, or is reset.",
    **dict.fromkeys(DEVICES, "Its port fails, as if unplugged."),
    "gps.sky": "The receiver loses its fix.",
    "gps.offset": "All positions are so far to the east.",
    "robot.carried": "Moves the robot; inside an obstacle it stays where it was.",
    "robot.rolled": "Inclines the robot, right side down; only the board's accelerometer notices.",
}
