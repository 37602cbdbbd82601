"""Simulator commands of the dashboard: faults and pillars while the robot runs."""

import math
from collections.abc import Mapping
from typing import Any

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper_hil.bench.bench import Bench
from thumper_hil.faults.catalogue import FAULTS, Amount, Choice, FaultValue, effect_of, title_of
from thumper_hil.world.world_file import suggested_worlds, world_titles

SMALLEST_PILLAR_M, LARGEST_PILLAR_M = 0.02, 2.0
FARTHEST_PILLAR_M = 50.0
COMMANDS = ("fault", "pillar", "clear_pillars", "clear_faults")


class PageControls:
    """The commands to one bench. A command is a JSON object with one of `COMMANDS` and its arguments."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._active: dict[str, FaultValue] = {}

    def describe(self) -> dict[str, Any]:
        """Return the world, all faults with their possible values, the active ones, and the pillars."""
        return {
            "faults": {
                name: {**_values(kind), "title": title_of(name), "effect": effect_of(name)}
                for name, kind in FAULTS.items()
            },
            "on": dict(self._active),
            "pillars": self._bench.pillars,
            "world": self._bench.world_name,
            "worlds": suggested_worlds(),
            "titles": world_titles(),
        }

    def apply(self, content: Mapping[str, Any]) -> str:
        """Execute a command; return a message that says what was done. Raise ThumperError if it fails."""
        match dict(content):
            case {"fault": str(name), "value": value, **rest} if not rest:
                self._bench.fault(name, value)
                self._active.pop(name, None)
                if FAULTS[name].persists(value):
                    self._active[name] = value
                return f"{title_of(name)}: {value}"
            case {"pillar": dict(pillar), **rest} if not rest and set(pillar) == {"x_m", "y_m", "radius_m"}:
                x_m, y_m, radius_m = (_number(pillar[name]) for name in ("x_m", "y_m", "radius_m"))
                if not SMALLEST_PILLAR_M <= radius_m <= LARGEST_PILLAR_M:
                    raise ThumperError(
                        f"the radius of a pillar must be {SMALLEST_PILLAR_M:g}...{LARGEST_PILLAR_M:g} m"
                    )
                if math.hypot(x_m, y_m) > FARTHEST_PILLAR_M:
                    raise ThumperError(f"a pillar must be within {FARTHEST_PILLAR_M:g} m of the robot")
                at = self._bench.add_pillar(Pose2(x_m=x_m, y_m=y_m), radius_m)
                return f"added a pillar at {at.x_m:.2f}, {at.y_m:.2f} in the world"
            case {"clear_pillars": True, **rest} if not rest:
                self._bench.clear_pillars()
                return "removed the pillars"
            case {"clear_faults": True, **rest} if not rest:
                for name in self._active:
                    self._bench.fault(name, self._normal(name))
                self._active.clear()
                return "removed all faults"
        raise ThumperError(f"unknown simulator command; give one of {', '.join(COMMANDS)} with its arguments")

    def _normal(self, name: str) -> FaultValue:
        """Return the value without the fault: of the battery, what it started with."""
        kind, battery = FAULTS[name], self._bench.battery
        started = {"battery.charge": battery.state_of_charge, "battery.resistance": battery.resistance_Ohm}
        if name in started:
            return started[name]
        return kind.normal or 0.0 if isinstance(kind, Amount) else "ok"


def _values(kind: object) -> dict[str, Any]:
    if isinstance(kind, Choice):
        return {"choices": list(kind.actions)}
    if isinstance(kind, Amount):
        normal = {"normal": kind.normal} if kind.normal is not None and not kind.is_transient else {}
        return {"most": kind.maximum, "unit": kind.unit, **normal}
    return {"pose": True}  # x_m, y_m, heading_deg


def _number(value: object) -> float:
    if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        return float(value)
    raise ThumperError("a pillar needs x_m, y_m (relative to the robot) and radius_m, all numbers")
