"""KLD sampling: draw more particles the more cells of poses they fill.

Fox, "Adapting the sample size in particle filters through KLD-sampling", IJRR 22(12), 2003, table 1.
"""

import math

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.slam.localization.options import AmclOptions

MAX_KL_DISTANCE = 0.05  # epsilon: allowed distance to the true distribution ...
QUANTILE = 2.33  # z: ... with a probability of 99 %
CELL_M, CELL_RAD = 0.25, 0.2  # particles in one such cell count as one hypothesis


def kld_resample(
    poses: FloatArray, weights: FloatArray, options: AmclOptions, rng: np.random.Generator
) -> FloatArray:
    """Draw poses by weight until there are enough for the cells that they fill; shape (drawn, 3)."""
    drawn = poses[rng.choice(len(poses), size=options.most_particles, p=weights)]
    cells = np.floor(drawn / (CELL_M, CELL_M, CELL_RAD)).astype(np.int64)
    filled: set[tuple[int, int, int]] = set()
    count = len(drawn)
    for i, (a, b, c) in enumerate(cells.tolist(), start=1):
        filled.add((a, b, c))
        if i >= options.least_particles and i >= required_particles(len(filled)):
            count = i
            break
    return drawn[:count].copy()


def required_particles(filled_cells: int) -> float:
    """Return the number of particles that bounds the KL distance (Wilson-Hilferty approximation)."""
    if filled_cells < 2:
        return 0.0
    k = 2.0 / (9.0 * (filled_cells - 1))
    root = 1.0 - k + math.sqrt(k) * QUANTILE
    return (filled_cells - 1) / (2.0 * MAX_KL_DISTANCE) * root**3
