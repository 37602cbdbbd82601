"""What a simulated robot can be told in its URL: `sim://NAME/board?world=lab&x_m=1.73&yaw_deg=180&seed=1`."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Self

from thumper.board.messages import Board as BoardKind
from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2

FULL_TURN_DEG = 360.0
LIDARS = ("urg04lx", "ld19")


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchOptions:
    """The world, where the robot stands in it, the seed of all that is random, and the pace."""

    world: str = "lab"
    x_m: float = 0.0
    y_m: float = 0.0
    yaw_deg: float = 0.0
    seed: int = 1
    charge: float | None = None  # of the battery, 0...1; the robot's own if not given
    board: BoardKind = BoardKind.TREX
    scenario: str = ""  # a TOML of faults; none if empty
    lidar: str = "urg04lx"  # its model; ld19 is the other one
    reset_on_open: bool = False  # opening the board's port resets it, through its boot loader
    realtime: bool = False  # keep to the clock on the wall, for somebody who watches

    @property
    def start(self) -> Pose2:
        """Where the robot stands."""
        return Pose2(x_m=self.x_m, y_m=self.y_m, theta_rad=math.radians(self.yaw_deg))

    @classmethod
    def parse(cls, options: Mapping[str, str]) -> Self:
        """Read the options of a URL.

        Raises
        ------
        ThumperError
            An option that does not exist, or a value that it cannot have.
        """
        readers: dict[str, Callable[[str], object]] = {
            "world": str,
            "x_m": _finite,
            "y_m": _finite,
            "yaw_deg": _angle_deg,
            "seed": _natural,
            "charge": _share,
            "board": _board,
            "scenario": str,
            "lidar": _lidar,
            "reset_on_open": _yes_or_no,
            "pace": _is_realtime,
        }
        values: dict[str, object] = {}
        for name, text in options.items():
            if name not in readers:
                known = ", ".join(readers)
                raise ThumperError(
                    f"the simulator has no option {name!r}; it has {known}", exit_code=EXIT_USAGE
                )
            try:
                values["realtime" if name == "pace" else name] = readers[name](text)
            except ValueError as error:
                raise ThumperError(
                    f"the simulator's option {name}={text}: {error}", exit_code=EXIT_USAGE
                ) from error
        return cls(**values)  # type: ignore[arg-type]  # each reader returns its field's type


def _finite(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError("give a number")
    return value


def _angle_deg(text: str) -> float:
    value = _finite(text)
    if abs(value) > FULL_TURN_DEG:
        raise ValueError("give an angle in degrees, -360...360")
    return value


def _natural(text: str) -> int:
    if not text.isascii() or not text.isdigit() or int(text) >= 2**63:
        raise ValueError("give a whole number from 0 on")
    return int(text)


def _share(text: str) -> float:
    value = _finite(text)
    if not 0.0 <= value <= 1.0:
        raise ValueError("give a share, 0...1")
    return value


def _board(text: str) -> BoardKind:
    try:
        return BoardKind[text.upper()]
    except KeyError:
        raise ValueError(f"give {' or '.join(kind.name.lower() for kind in BoardKind)}") from None


def _lidar(text: str) -> str:
    if text not in LIDARS:
        raise ValueError(f"give {' or '.join(LIDARS)}")
    return text


def _yes_or_no(text: str) -> bool:
    if text not in {"0", "1"}:
        raise ValueError("give 0 or 1")
    return text == "1"


def _is_realtime(text: str) -> bool:
    if text not in {"fast", "realtime"}:
        raise ValueError("give fast or realtime")
    return text == "realtime"
