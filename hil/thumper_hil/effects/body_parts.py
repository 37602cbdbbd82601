"""What the effects need to know of the robot, read from `body_parts.toml`."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated

from annotated_types import Gt
from pydantic import TypeAdapter, with_config

from thumper.common.strict_toml import STRICT, read_checked

Positive = Annotated[float, Gt(0)]


@with_config(STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class Wheels:
    """Where the wheels are on the body."""

    count: Annotated[int, Gt(0)]
    axle_m: Positive
    half_track_m: Positive
    sill_half_width_m: Positive


@with_config(STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class Springs:
    """The suspension on which the body pitches, and the height of the lidar on it."""

    natural_Hz: Positive
    damping: Positive
    shake_time_s: Positive
    lidar_height_m: Positive


@with_config(STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class Cable:
    """A loose cable that the lidar sees; its bearing is counter-clockwise from the lidar's front."""

    bearing_deg: float
    width_deg: Positive
    range_m: Positive


@with_config(STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class BodyParts:
    """Parts of the robot that only effects know."""

    wheels: Wheels
    springs: Springs
    cable: Cable


@cache
def body_parts() -> BodyParts:
    """Return the parts as the TOML file describes them."""
    path = Path(__file__).with_name("body_parts.toml")
    return read_checked(path, TypeAdapter(BodyParts), BodyParts, "parts")
