"""Which changes of a path count as a change of route."""

import math

import numpy as np
import pytest

from thumper.common.geometry import FloatArray
from thumper_hil.courses.route_changes import count_route_changes, winding_numbers

POSTS_M = np.array(((1.0, 0.0), (3.0, 0.0)))
STRAIGHT_M = np.column_stack((np.linspace(0.0, 4.0, 81), np.full(81, 0.05)))


def bent(*sides: float) -> FloatArray:
    """Return a path that passes the two posts at these y."""
    x_m = np.linspace(0.0, 4.0, 81)
    return np.column_stack(
        (x_m, np.interp(x_m, (0.0, 1.0, 2.0, 3.0, 4.0), (0.0, sides[0], 0.0, sides[1], 0.0)))
    )


def test_the_same_sides_are_no_change() -> None:
    plans = [bent(0.5, 0.5), bent(0.5, 0.5)[10:], bent(0.2, 0.3), np.empty((0, 2)), bent(0.4, 0.1)[5:]]
    assert count_route_changes(plans, POSTS_M) == (0, 0)


def test_a_new_side_is_a_change_and_the_old_one_again_a_flip() -> None:
    assert count_route_changes([bent(0.5, 0.5), bent(0.5, -0.5)], POSTS_M) == (1, 0)
    assert count_route_changes([bent(0.5, 0.5), bent(0.5, -0.5), bent(-0.5, -0.5)], POSTS_M) == (2, 0)
    assert count_route_changes([bent(0.5, 0.5), bent(0.5, -0.5), bent(0.5, 0.5)], POSTS_M) == (2, 1)
    assert count_route_changes([bent(0.5, 0.5), bent(-0.5, -0.5), bent(-0.5, 0.5)], POSTS_M) == (2, 1)


@pytest.mark.parametrize("turns", [-2, -1, 1, 2])
def test_winding_numbers_count_turns(turns: int) -> None:
    angle_rad = np.linspace(0.0, 2.0 * math.pi * turns, 200)
    loop_m = np.column_stack((np.cos(angle_rad), np.sin(angle_rad)))
    assert winding_numbers(loop_m, np.array(((0.1, 0.2), (2.0, 0.0), (0.0, -2.0)))).tolist() == [turns, 0, 0]
