"""Parts of the matcher on one grid."""

import numpy as np
import pytest

from thumper.slam.grid.grid_matcher import upper_quartile


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 180, 361, 682])
def test_the_quartile_is_that_of_numpy(count: int) -> None:
    values = np.random.default_rng(count).uniform(0.1, 30.0, count)
    assert upper_quartile(values) == pytest.approx(np.percentile(values, 75.0), rel=1e-14)
