"""The result of a soak run."""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

MIN_DRIVES_PER_TENTH = 10  # in shorter runs, kernels that load on first use dominate the memory


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
    memory_MB: list[float] = field(default_factory=list)  # resident memory after each drive
    failures: list[str] = field(default_factory=list)

    @property
    def growth_MB(self) -> float:
        """Memory growth from the second tenth of the drives to the last; 0 in a short run."""
        tenth = len(self.memory_MB) // 10
        if tenth < MIN_DRIVES_PER_TENTH:
            return 0.0
        early, late = self.memory_MB[tenth : 2 * tenth], self.memory_MB[-tenth:]
        return float(np.median(late) - np.median(early))

    def lines(self, real_s: float) -> list[str]:
        """Return the report as text; `real_s` is the run's duration in real time."""
        return [
            f"{self.simulated_s / 3600.0:.2f} simulated hours in {real_s / 60.0:.1f} min, "
            f"{self.drives} drives",
            f"goals reached: {self.required_reached} of {self.required} drives without a stopping fault, "
            f"{self.reached - self.required_reached} of the others",
            f"{sum(self.faults.values())} faults, longest stop {self.longest_stop_s:.2f} s, "
            f"{self.contacts} contacts",
            f"memory {self.memory_MB[0]:.0f} MB after the first drive, {self.memory_MB[-1]:.0f} MB after the "
            f"last; last tenth minus second tenth {self.growth_MB:+.1f} MB",
            ", ".join(f"{name} {count}" for name, count in sorted(self.faults.items())),
            *(f"FAILED: {failure}" for failure in self.failures),
        ]
