"""How hard the simulated robot is: the strength of every disturbance, read from a preset's TOML."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated

from annotated_types import Ge, Gt, Le
from pydantic import TypeAdapter, with_config

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.strict_toml import STRICT, read_checked

PRESETS = ("nominal", "hard")
Share = Annotated[float, Ge(0), Le(1)]
NotNegative = Annotated[float, Ge(0)]


@with_config(STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class HostEffects:
    """The host computer: how slow it is and how late it wakes up."""

    cpu_factor: NotNegative
    wake_up_s: NotNegative
    usb_latency_s: NotNegative
    hiccup_s: NotNegative
    hiccup_share: Share


@with_config(STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class BodyEffects:
    """Floor, tyres and springs."""

    floor: str
    loaded_radius_loss: Share
    distance_spread: Share
    centre_offset_m: NotNegative
    centre_wander_m: NotNegative
    pitch_deg_per_m_s2: NotNegative
    pitch_noise_deg: NotNegative


@with_config(STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class MountEffects:
    """The lidar's true mounting against the one in the robot's TOML."""

    offset_m: NotNegative
    yaw_deg: NotNegative
    tilt_deg: NotNegative


@with_config(STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class ClockEffects:
    """The clocks of board and lidar against the host's."""

    board_drift: Share
    lidar_drift: Share


@with_config(STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class LidarEffects:
    """What all lidar models have in common: surfaces, edges, the robot's own parts, transport."""

    delay_s: NotNegative
    mixed_share: Share
    loss_share: Share
    grazing_deg: Annotated[float, Gt(0), Le(90)]
    surfaces: bool
    self_return_share: Share


@with_config(STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class HouseEffects:
    """What makes some of the random houses harder than others."""

    carpet_share: Share
    dark_legs_share: Share


@with_config(STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class Preset:
    """The strength of every disturbance. The TOML file gives the meaning and the source of each value."""

    host: HostEffects
    body: BodyEffects
    mount: MountEffects
    clock: ClockEffects
    lidar: LidarEffects
    house: HouseEffects


@cache
def load_preset(name: str) -> Preset:
    """Read the preset `nominal` or `hard`.

    Raises
    ------
    ThumperError
        There is no such preset.
    """
    if name not in PRESETS:
        raise ThumperError(f"unknown preset {name!r}; choose from {', '.join(PRESETS)}", exit_code=EXIT_USAGE)
    path = Path(__file__).with_name(f"{name}.toml")
    return read_checked(path, TypeAdapter(Preset), Preset, "preset")
