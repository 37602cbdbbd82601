"""How many particles are enough (Fox 2003): more where those that were drawn fill more cells of poses."""

import math

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.slam.localization.options import AmclOptions


def resampled(
    poses: FloatArray, weights: FloatArray, options: AmclOptions, rng: np.random.Generator
) -> FloatArray:
    """Draw poses by weight until the cells that they fill have enough of them (table 1); shape (drawn, 3)."""
    drawn = poses[rng.choice(len(poses), size=options.most_particles, p=weights)]
    cells = np.floor(drawn / (options.kld_cell_m, options.kld_cell_m, options.kld_cell_rad)).astype(np.int64)
    seen: set[tuple[int, int, int]] = set()
    count = len(drawn)
    for i, (a, b, c) in enumerate(cells.tolist(), start=1):
        seen.add((a, b, c))
        if i >= options.least_particles and i >= _enough(len(seen), options):
            count = i
            break
    return drawn[:count].copy()


def _enough(filled: int, options: AmclOptions) -> float:
    """Particles that bound the KL distance when `filled` cells are in use."""
    if filled < 2:
        return 0.0
    k = 2.0 / (9.0 * (filled - 1))
    root = 1.0 - k + math.sqrt(k) * options.kld_quantile
    return (filled - 1) / (2.0 * options.kld_error) * root**3
