"""Physical parameters of the simulated robot, read from TOML and flattened for the C++ simulator."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal

import numpy as np

from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray
from thumper.common.toml_file import load_toml
from thumper_hil.effects.friction import scrub_moment_Nm, traction_Nm

WILD_THUMPER = Path(__file__).with_name("wild_thumper.toml")
OPEN_CIRCUIT_POINTS = 11  # at 0, 10, ... 100 % charge

# The fields have the order of chip/native/params.hpp. The TOML file explains each value and its source.


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorParams:
    """One motor with gearbox and wheel, referred to the wheel side of the gearbox."""

    motors_per_side: float
    resistance_Ohm: float
    torque_Nm_A: float
    back_emf_V_s_rad: float
    inertia_kg_m2: float
    viscous_Nm_s_rad: float
    coulomb_Nm: float
    static_ratio: float
    noise_Nm: float
    noise_time_s: float
    spread_ratio: float
    unit_spread_ratio: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BatteryParams:
    """The battery: `open_circuit_V` at 0, 10, ... 100 % charge."""

    capacity_Ah: float
    resistance_Ohm: float
    state_of_charge: float
    idle_current_A: float
    open_circuit_V: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.open_circuit_V) != OPEN_CIRCUIT_POINTS:
            raise ValueError(
                f"open_circuit_V: give {OPEN_CIRCUIT_POINTS} voltages, not {len(self.open_circuit_V)}"
            )
        if not 0.0 <= self.state_of_charge <= 1.0:
            raise ValueError(f"state_of_charge: must be 0...1, not {self.state_of_charge}")


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyParams:
    """The chassis and its tyres; `track_m` is the effective track, which determines the yaw rate."""

    mass_kg: float
    yaw_inertia_kg_m2: float
    wheel_radius_m: float
    radius_spread_ratio: float
    track_m: float
    track_growth_s: float
    track_spread_ratio: float
    track_noise_ratio: float
    track_noise_time_s: float
    centre_offset_m: float
    centre_wander_m: float
    centre_time_s: float
    friction: float
    scrub_slip_rad_s: float

    @property
    def scrub_Nm(self) -> float:
        """Moment that the sliding tyres oppose to a turn."""
        return scrub_moment_Nm(self.friction, self.mass_kg, self.track_m)

    @property
    def traction_Nm(self) -> float:
        """Torque at which the wheels of one side spin against an obstacle."""
        return traction_Nm(self.friction, self.mass_kg, self.wheel_radius_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class OutlineParams:
    """The rectangle round the chassis and its tyres, centred on `base_link`. The C++ simulator needs none."""

    length_m: float
    width_m: float

    def corners_m(self) -> FloatArray:
        """Return the corners, shape (4, 2) [m], counter-clockwise from the front left."""
        x_m, y_m = 0.5 * self.length_m, 0.5 * self.width_m
        return np.array(((x_m, y_m), (-x_m, y_m), (-x_m, -y_m), (x_m, -y_m)))


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderParams:
    """A quadrature encoder on each side."""

    counts_per_rev: float
    edge_error_counts: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardParams:
    """The bridges' behaviour at PWM 0, and the scaling of voltage and currents at the ADC."""

    pwm_low: Literal["coast", "brake"]
    battery_V_per_count: float
    current_A_per_count: float
    current_zero_counts: float
    clock_drift: float

    def __post_init__(self) -> None:
        if self.pwm_low not in ("coast", "brake"):
            raise ValueError(f"pwm_low: must be coast or brake, not {self.pwm_low!r}")


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotParams:
    """All parameters of the simulated robot."""

    motor: MotorParams
    battery: BatteryParams
    body: BodyParams
    outline: OutlineParams
    encoder: EncoderParams
    board: BoardParams

    @classmethod
    def load(cls, path: Path = WILD_THUMPER) -> "RobotParams":
        """Read a TOML file.

        Raises
        ------
        ThumperError
            The file cannot be read, a key is missing or unknown, or a value is invalid.
        """
        try:
            tables = load_toml(path)
            return cls(
                **{part.name: _part(part.type, tables.pop(part.name), part.name) for part in fields(cls)}
            )
        except KeyError as error:
            raise ThumperError(f"{path}: the table [{error.args[0]}] is missing; add it") from error
        except (OSError, ValueError, TypeError) as error:
            raise ThumperError(f"{path}: {error}") from error

    def flat(self) -> list[float]:
        """Return all numbers in the order of chip/native/params.hpp."""
        numbers: list[float] = []
        for part in fields(self):
            if part.name == "outline":
                continue
            table = getattr(self, part.name)
            for entry in fields(table):
                value = getattr(table, entry.name)
                if isinstance(value, str):
                    value = float(value == "coast")
                if entry.name == "friction":
                    value = (table.scrub_Nm, table.traction_Nm)
                numbers.extend(value if isinstance(value, tuple) else (value,))
        return numbers


def _part(part_type: Any, table: Any, name: str) -> Any:
    known = {entry.name for entry in fields(part_type)}
    if missing := known - table.keys():
        raise ValueError(f"{name}.{min(missing)} is missing")
    if unknown := table.keys() - known:
        raise ValueError(f"unknown key {name}.{min(unknown)}; choose from {', '.join(sorted(known))}")
    return part_type(**{key: _value(value, f"{name}.{key}") for key, value in table.items()})


def _value(value: Any, key: str) -> str | float | tuple[float, ...]:
    if isinstance(value, str) and key == "board.pwm_low":
        return value
    if isinstance(value, list):
        return tuple(float(number) for number in value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{key}: must be a number, not {value!r}")
    return float(value)
