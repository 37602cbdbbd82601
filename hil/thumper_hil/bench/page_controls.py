"""What a person at the page may do to a simulated robot and its world while it runs."""

import math
from collections.abc import Mapping
from typing import Any

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper_hil.bench.bench import Bench
from thumper_hil.faults.catalogue import FAULTS, Amount, Choice, FaultValue

SMALLEST_PILLAR_M, LARGEST_PILLAR_M = 0.02, 2.0
FARTHEST_PILLAR_M = 50.0
ORDERS = ("fault", "pillar", "clear_pillars")


class Controls:
    """Of one bench; an order is a JSON object with one of `ORDERS` and what belongs to it."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._on: dict[str, FaultValue] = {}

    def describe(self) -> dict[str, Any]:
        """Every fault with the values that it takes, those ordered that last, and how many pillars stand."""
        return {
            "faults": {name: _values(kind) for name, kind in FAULTS.items()},
            "on": dict(self._on),
            "pillars": self._bench.pillars,
        }

    def apply(self, content: Mapping[str, Any]) -> str:
        """Do it; returns what was done, in words. Raises ThumperError."""
        match dict(content):
            case {"fault": str(name), "value": value, **rest} if not rest:
                self._bench.fault(name, value)
                self._on.pop(name, None)
                if FAULTS[name].lasts(value):
                    self._on[name] = value
                return f"{name} is {value}"
            case {"pillar": dict(pillar), **rest} if not rest and set(pillar) == {"x_m", "y_m", "radius_m"}:
                x_m, y_m, radius_m = (_number(pillar[name]) for name in ("x_m", "y_m", "radius_m"))
                if not SMALLEST_PILLAR_M <= radius_m <= LARGEST_PILLAR_M:
                    raise ThumperError(f"a pillar's radius is {SMALLEST_PILLAR_M:g}...{LARGEST_PILLAR_M:g} m")
                if math.hypot(x_m, y_m) > FARTHEST_PILLAR_M:
                    raise ThumperError(f"a pillar stands within {FARTHEST_PILLAR_M:g} m of the robot")
                at = self._bench.put_pillar(Pose2(x_m=x_m, y_m=y_m), radius_m)
                return f"a pillar stands at {at.x_m:.2f}, {at.y_m:.2f} of the world"
            case {"clear_pillars": True, **rest} if not rest:
                self._bench.clear_pillars()
                return "the pillars are gone"
        raise ThumperError(f"the simulator takes one of {', '.join(ORDERS)}, with what belongs to it")


def _values(kind: object) -> dict[str, Any]:
    if isinstance(kind, Choice):
        return {"choices": list(kind.acts)}
    if isinstance(kind, Amount):
        return {"most": kind.most, "unit": kind.unit}
    return {"pose": True}  # x_m, y_m, heading_deg


def _number(value: object) -> float:
    if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        return float(value)
    raise ThumperError("a pillar is x_m, y_m (from the robot) and radius_m, all of them numbers")
