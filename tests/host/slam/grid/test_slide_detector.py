"""The scans themselves distinguish a match that slides along similar walls from slipping wheels."""

import numpy as np
import pytest

from thumper.common.geometry import FloatArray, Pose2
from thumper.slam.grid.slide_detector import SlideDetector

STEP_M = 0.1


def view(at_m: float) -> FloatArray:
    """Return the walls of a corridor with pillars every 2 m, seen from this far along it, shape (n, 2)."""
    along_m = np.arange(-3.0, 3.0, 0.04)
    walls = [np.column_stack((along_m, np.full(along_m.size, y))) for y in (-1.2, 1.2)]
    near = np.arange(np.ceil((at_m - 3.0) / 2.0), (at_m + 3.0) / 2.0) * 2.0 - at_m
    pillars = [np.column_stack((np.full(20, x), np.linspace(-1.2, 1.2, 20))) for x in near]
    return np.concatenate((*walls, *(pillars * 4)))


def drive(detector: SlideDetector, true_m: float, wheels_m: float, match_m: float) -> None:
    """Drive 50 steps along x; in each the robot, wheels and match move this much."""
    for step in range(50):
        detector.update(view(step * true_m), Pose2(x_m=wheels_m), Pose2(x_m=match_m), 0.0)


@pytest.mark.parametrize("match_m", [0.03, 0.17])
def test_a_sliding_match_is_lost(match_m: float) -> None:
    detector = SlideDetector(1.0)
    drive(detector, STEP_M, 1.03 * STEP_M, match_m)
    assert "slid" in detector.lost
    detector.reset()
    assert not detector.lost


def test_slipping_wheels_are_no_slide() -> None:
    detector = SlideDetector(1.0)
    drive(detector, 0.5 * STEP_M, STEP_M, 0.5 * STEP_M)
    assert not detector.lost


def test_wheels_that_read_long_are_no_slide() -> None:
    detector = SlideDetector(1.0)
    drive(detector, STEP_M, 1.2 * STEP_M, STEP_M)
    assert not detector.lost


def test_a_match_that_slides_back_is_known_again() -> None:
    detector = SlideDetector(1.0)
    drive(detector, STEP_M, STEP_M, 0.03)
    assert detector.lost
    drive(detector, STEP_M, STEP_M, 0.17)
    assert not detector.lost
