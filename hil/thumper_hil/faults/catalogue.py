"""Every fault by its name, with the values that it takes. `apply` is what call and scenario line both do."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

from thumper.common.geometry import Pose2
from thumper_hil.chip.chip_faults import WireFault
from thumper_hil.faults.switches import CHANNELS, SIDES, Switches

FaultValue = str | float | list[float]


class FaultError(ValueError):
    """No such fault, or a value that it cannot have; the caller adds where it was read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """A fault that takes one of some words."""

    acts: Mapping[str, Callable[[Switches], None]]

    def action(self, value: object) -> Callable[[Switches], None]:
        """Return what the word does."""
        if not isinstance(value, str) or value not in self.acts:
            raise FaultError(f"{value!r}: give {' or '.join(self.acts)}")
        return self.acts[value]

    def lasts(self, value: object) -> bool:
        """Whether something is wrong from now on, until the next value."""
        return "ok" in self.acts and value != "ok"


@dataclass(frozen=True, slots=True, kw_only=True)
class Amount:
    """A fault that takes a number within bounds."""

    act: Callable[[Switches, float], None]
    unit: str
    most: float
    well: float | None = 0.0  # at which nothing is wrong; None: any amount is a change
    passes: bool = False  # by itself

    def action(self, value: object) -> Callable[[Switches], None]:
        """Return what the number does."""
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= self.most:
            raise FaultError(f"{value!r}: give a number, 0...{self.most:g} {self.unit}".rstrip())
        return partial(self._apply, float(value))

    def lasts(self, value: object) -> bool:
        """Whether something is wrong from now on, until the next value."""
        return not self.passes and value != self.well

    def _apply(self, amount: float, switches: Switches) -> None:
        self.act(switches, amount)


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultSite:
    """The robot is carried somewhere: x [m], y [m], heading [deg]."""

    def action(self, value: object) -> Callable[[Switches], None]:
        """Return what puts it there."""
        if not isinstance(value, list | tuple) or len(value) != 3 or not all(map(_finite, value)):
            raise FaultError(f"{value!r}: give [x_m, y_m, heading_deg]")
        x_m, y_m, heading_deg = value
        pose = Pose2(x_m=float(x_m), y_m=float(y_m), theta_rad=math.radians(heading_deg))
        return lambda switches: switches.carry_to(pose)

    def lasts(self, _value: object) -> bool:
        """It was carried, and that is all."""
        return False


def action_of(name: str, value: object) -> Callable[[Switches], None]:
    """Return what the fault does to a bench; raises FaultError for a wrong name or value."""
    if name not in FAULTS:
        raise FaultError(f"no fault {name!r}; there are {', '.join(FAULTS)}")
    try:
        return FAULTS[name].action(value)
    except FaultError as error:
        raise FaultError(f"{name} = {error}") from None


def _finite(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _wire(side: int, channel: int) -> Choice:
    def breaking(fault: WireFault) -> Callable[[Switches], None]:
        return lambda switches: switches.break_wire(side, channel, fault)

    return Choice(acts={fault.name.lower(): breaking(fault) for fault in WireFault})


def _motor(side: int) -> Choice:
    return Choice(
        acts={
            "ok": lambda switches: switches.change_side(side, connected=1.0, reversed=False, shorted=False),
            "dead": lambda switches: switches.change_side(side, connected=0.0),
            "swapped": lambda switches: switches.change_side(side, reversed=True),
            "shorted": lambda switches: switches.change_side(side, shorted=True),
        }
    )


def _wheels(side: int) -> Choice:
    return Choice(
        acts={
            "ok": lambda switches: switches.change_side(side, blocked=False),
            "blocked": lambda switches: switches.change_side(side, blocked=True),
        }
    )


def _channels(side: int) -> Choice:
    return Choice(
        acts={
            "ok": lambda switches: switches.chip.swap_channels(side, swapped=False),
            "swapped": lambda switches: switches.chip.swap_channels(side, swapped=True),
        }
    )


def _glitches(side: int) -> Amount:
    return Amount(
        act=lambda switches, per_s: switches.chip.set_glitches(side, per_s), unit="1/s", most=50_000.0
    )


def _slip(side: int) -> Amount:
    return Amount(act=lambda switches, share: switches.change_side(side, slip=share), unit="", most=1.0)


def _hang_host(switches: Switches, duration_s: float) -> None:
    switches.host_hangs_until_s = switches.chip.time_s + duration_s


FAULTS: dict[str, Choice | Amount | FaultSite] = {
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
    "battery.charge": Amount(
        act=lambda switches, share: switches.chip.set_battery(charge=share), unit="", most=1.0, well=None
    ),
    "battery.resistance": Amount(
        act=lambda switches, ohm: switches.chip.set_battery(resistance_Ohm=ohm),
        unit="Ohm",
        most=10.0,
        well=None,
    ),
    "line.loss": Amount(act=lambda switches, share: switches.set_line(line_loss=share), unit="", most=1.0),
    "line.noise": Amount(act=lambda switches, share: switches.set_line(line_flip=share), unit="", most=1.0),
    "host.hang": Amount(act=_hang_host, unit="s", most=60.0, passes=True),
    "firmware": Choice(
        acts={
            "loop": lambda switches: switches.chip.hang(interrupts_off=False),
            "hang": lambda switches: switches.chip.hang(interrupts_off=True),
            "reset": lambda switches: switches.chip.reset(),
        }
    ),
    "board": Choice(
        acts={
            "ok": lambda switches: setattr(switches, "board_plugged", True),
            "unplugged": lambda switches: setattr(switches, "board_plugged", False),
        }
    ),
    "lidar": Choice(
        acts={
            "ok": lambda switches: setattr(switches, "lidar_plugged", True),
            "unplugged": lambda switches: setattr(switches, "lidar_plugged", False),
        }
    ),
    "robot.carried": FaultSite(),
}
