"""Options in a simulated robot's URL: `sim://NAME/board?world=lab&x_m=1.73&yaw_deg=180&seed=1`."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Self

from thumper.board.messages import BoardModel
from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2
from thumper.common.texts import choice_hint
from thumper_hil.effects.friction import floors
from thumper_hil.effects.preset import PRESETS
from thumper_hil.world.house import house_mission, house_number

FULL_TURN_DEG = 360.0
FIX_KINDS = ("autonomous", "sbas", "rtk")
GPS_RATES, GPS_PROTOCOLS = range(1, 11), ("nmea", "ubx")
LIDARS = ("urg04lx", "ld19", "rplidar_a1", "rplidar_a2", "rplidar_c1", "ydlidar_x4")


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchOptions:
    """World, start pose, random seed, hardware and pace of a simulated robot."""

    world: str = "lab"
    x_m: float = 0.0
    y_m: float = 0.0
    yaw_deg: float = 0.0
    seed: int = 1
    charge: float | None = None  # battery charge, 0...1; None: from the robot's parameters
    board: BoardModel = BoardModel.TREX
    scenario: str = ""  # path of a TOML of faults; empty for none
    lidar: str = "urg04lx"  # model, one of LIDARS
    gps: str = "sbas"  # kind of fix: autonomous, sbas or rtk
    gps_Hz: int = 1  # epochs per second
    gps_protocol: str = "nmea"  # what the receiver sends: nmea or ubx
    preset: str = "nominal"  # how hard the robot is to drive: nominal or hard
    floor: str = ""  # carpet, wood..., or stand for wheels in the air; empty: the preset's floor
    reset_on_open: bool = False  # opening the board's port resets it through its boot loader
    bare: bool = False  # the board holds its boot loader only
    realtime: bool = False  # run in real time

    @property
    def start(self) -> Pose2:
        """The start pose."""
        return Pose2(x_m=self.x_m, y_m=self.y_m, theta_rad=math.radians(self.yaw_deg))

    @classmethod
    def parse(cls, options: Mapping[str, str]) -> Self:
        """Parse the options of a URL; without a start pose a robot in a house starts where its mission does.

        Raises
        ------
        ThumperError
            An option is unknown or its value is invalid.
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
            "gps": _gps,
            "gps_Hz": _gps_rate,
            "gps_protocol": _gps_protocol,
            "preset": _preset,
            "floor": _floor,
            "reset_on_open": _yes_or_no,
            "bare": _yes_or_no,
            "pace": _is_realtime,
        }
        values: dict[str, object] = {}
        for name, text in options.items():
            if name not in readers:
                hint = choice_hint(name, readers)
                raise ThumperError(f"unknown simulator option {name!r}; {hint}", exit_code=EXIT_USAGE)
            try:
                values["realtime" if name == "pace" else name] = readers[name](text)
            except ValueError as error:
                raise ThumperError(
                    f"simulator option {name}={text}: {error}", exit_code=EXIT_USAGE
                ) from error
        house = house_number(str(values.get("world", "")))
        if house is not None and not values.keys() & {"x_m", "y_m", "yaw_deg"}:
            start = house_mission(house).start
            values |= {"x_m": start.x_m, "y_m": start.y_m, "yaw_deg": math.degrees(start.theta_rad)}
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
        raise ValueError("give a whole number, 0 or more")
    return int(text)


def _share(text: str) -> float:
    value = _finite(text)
    if not 0.0 <= value <= 1.0:
        raise ValueError("give a share, 0...1")
    return value


def _board(text: str) -> BoardModel:
    try:
        return BoardModel[text.upper()]
    except KeyError:
        raise ValueError(f"give {' or '.join(kind.name.lower() for kind in BoardModel)}") from None


def _lidar(text: str) -> str:
    if text not in LIDARS:
        raise ValueError(f"give {' or '.join(LIDARS)}")
    return text


def _gps(text: str) -> str:
    if text not in FIX_KINDS:
        raise ValueError(f"give {' or '.join(FIX_KINDS)}")
    return text


def _gps_rate(text: str) -> int:
    if text not in {str(rate) for rate in GPS_RATES}:
        raise ValueError("give a whole number, 1 to 10")
    return int(text)


def _gps_protocol(text: str) -> str:
    if text not in GPS_PROTOCOLS:
        raise ValueError(f"give {' or '.join(GPS_PROTOCOLS)}")
    return text


def _preset(text: str) -> str:
    if text not in PRESETS:
        raise ValueError(f"give {' or '.join(PRESETS)}")
    return text


def _floor(text: str) -> str:
    if text not in floors():
        raise ValueError(f"give one of {', '.join(floors())}")
    return text


def _yes_or_no(text: str) -> bool:
    if text not in {"0", "1"}:
        raise ValueError("give 0 or 1")
    return text == "1"


def _is_realtime(text: str) -> bool:
    if text not in {"fast", "realtime"}:
        raise ValueError("give fast or realtime")
    return text == "realtime"
