"""The groups of linked cells are those of scipy, in the same order."""

import numpy as np
import pytest
from scipy.sparse import coo_array, csgraph

from thumper.navigation.planners.frontier_exploration import connected_components


@pytest.mark.parametrize("seed", range(30))
def test_components_are_those_of_scipy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 400))
    first, second = rng.integers(0, count, (2, int(rng.integers(0, 2 * count))))
    links = coo_array((np.ones(first.size, np.bool_), (first, second)), shape=(count, count))
    _, expected = csgraph.connected_components(links, directed=False)
    np.testing.assert_array_equal(connected_components(count, first, second), expected)


def test_a_long_chain_in_any_order_is_one_component() -> None:
    order = np.random.default_rng(0).permutation(20_000)
    assert not connected_components(20_000, order[:-1], order[1:]).any()
