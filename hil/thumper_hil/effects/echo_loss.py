"""Lost echoes: random runs of beams, as drop-outs in recorded scans come in runs."""

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray


def random_runs(share: FloatArray, length_beams: float, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return a mask of random runs of geometric length that cover `share` of the beams, shape (n,)."""
    starts = rng.random(share.size) < share / length_beams
    lengths = rng.geometric(1.0 / length_beams, share.size)
    ends = np.where(starts, np.arange(share.size) + lengths, 0)
    return np.asarray(np.arange(share.size) < np.maximum.accumulate(ends), np.bool_)
