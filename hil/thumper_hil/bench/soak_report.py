"""The result of a soak run."""

from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

WARM_S, WARM_FRACTION = 3600.0, 0.4  # kernels that load on first use, and caches, fill the memory at first
WINDOW_FRACTION = 0.2  # of the time after that: the medians of its first and last part are compared


class Usage(NamedTuple):
    """What the process holds after a drive."""

    time_s: float  # simulated
    memory_MB: float  # resident
    handles: int  # open files
    threads: int


@dataclass(slots=True, kw_only=True)
class SoakReport:
    """Counts, extremes and failures of a run."""

    simulated_s: float = 0.0
    drives: int = 0
    reached: int = 0
    required: int = 0  # drives without a fault that stops the robot: each must reach its goal
    required_reached: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    longest_stop_s: float = 0.0  # from a fault to stationary wheels
    contacts: int = 0
    restarts: int = 0  # of the robot, in the same map
    recorded_MB: float = 0.0  # in the recordings' folder at the end
    usage: list[Usage] = field(default_factory=list)  # after each drive
    failures: list[str] = field(default_factory=list)

    def growth(self) -> dict[str, float]:
        """Return how much memory, handles and threads grew after the warm-up, as fractions.

        Raises
        ------
        ValueError
            No drive ended in the first or the last part of the time after the warm-up.
        """
        warm_s = min(WARM_S, WARM_FRACTION * self.simulated_s)
        window_s = WINDOW_FRACTION * (self.simulated_s - warm_s)
        early = [each for each in self.usage if warm_s <= each.time_s < warm_s + window_s]
        late = [each for each in self.usage if each.time_s >= self.simulated_s - window_s]
        if not (early and late):
            raise ValueError("too few drives to compare")
        return {
            name: float(np.median([each[n] for each in late]) / np.median([each[n] for each in early])) - 1.0
            for n, name in enumerate(Usage._fields)
            if name != "time_s"
        }

    def lines(self, real_s: float) -> list[str]:
        """Return the report as text; `real_s` is the run's duration in real time."""
        return [
            f"{self.simulated_s / 3600.0:.2f} simulated hours in {real_s / 60.0:.1f} min, "
            f"{self.drives} drives",
            f"goals reached: {self.required_reached} of {self.required} drives without a stopping fault, "
            f"{self.reached - self.required_reached} of the others",
            f"{sum(self.faults.values())} faults, longest stop {self.longest_stop_s:.2f} s, "
            f"{self.contacts} contacts",
            f"{self.restarts} restarts in the same map, {self.recorded_MB:.1f} MB of recordings kept",
            f"after the first drive {_shown(self.usage[0])}; after the last {_shown(self.usage[-1])}",
            "growth after the warm-up: "
            + ", ".join(f"{name} {100.0 * part:+.1f} %" for name, part in self.growth().items()),
            ", ".join(f"{name} {count}" for name, count in sorted(self.faults.items())),
            *(f"FAILED: {failure}" for failure in self.failures),
        ]


def _shown(usage: Usage) -> str:
    return f"{usage.memory_MB:.0f} MB, {usage.handles} handles, {usage.threads} threads"
