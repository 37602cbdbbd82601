"""Some worlds of the BARN challenge, scaled down until the gaps are hardly wider than the robot."""

from pathlib import Path

import pytest

from thumper.navigation.options import NavigationOptions
from thumper_hil.kinematic.barn import drive_through, recorded_world


@pytest.mark.parametrize(("index", "scale"), [(60, 1.0), (0, 0.65), (240, 0.65), (165, 0.65), (60, 0.5)])
def test_crosses_the_field_without_contact(nav_data: Path, index: int, scale: float) -> None:
    """Start, goal and success as in the challenge, all lengths scaled; the map is empty at first."""
    run = drive_through(recorded_world(nav_data / "barn", index, scale), scale, NavigationOptions())
    assert run.goal_error_m < scale, run.reason
    assert run.clearance_m > 0.0
