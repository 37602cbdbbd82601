"""The robot waits while its data is old, says why, and gives up in the end."""

import numpy as np
import pytest

from thumper.common.geometry import Pose2, Twist2
from thumper.runtime.drive.data_age import LIDAR_LOST, DataAge
from thumper.runtime.state_estimator import RobotState


def state(time_s: float, scan_age_s: float = 0.1) -> RobotState:
    return RobotState(
        time_s=time_s,
        map_from_base=Pose2(),
        twist=Twist2(),
        hits_in_map_m=np.empty((0, 2)),
        scan_age_s=scan_age_s,
    )


@pytest.mark.parametrize(
    ("scan_age_s", "telemetry_age_s", "words"),
    [
        (0.1, 0.02, ""),
        (0.34, 0.29, ""),
        (0.56, 0.02, "its newest scan is 0.56 s old"),
        (0.1, 0.5, "overloaded, the data is 0.50 s old"),
        (1.2, 0.02, LIDAR_LOST),
        (np.inf, 0.02, LIDAR_LOST),
    ],
)
def test_the_problem_names_what_is_old(scan_age_s: float, telemetry_age_s: float, words: str) -> None:
    problem = DataAge().problem(state(10.0, scan_age_s), 10.0 + telemetry_age_s)
    assert words in problem
    assert bool(problem) == bool(words)


@pytest.mark.parametrize(("cycle_s", "words"), [(0.1, LIDAR_LOST), (1.3, "overloaded, the data is 1.30 s")])
def test_an_old_scan_after_a_slow_cycle_is_not_the_fault_of_the_lidar(cycle_s: float, words: str) -> None:
    age = DataAge()
    assert not age.problem(state(10.0), 10.0)
    late = state(10.0 + cycle_s, 1.2)
    assert words in age.problem(late, late.time_s)
    assert words in age.problem(late, late.time_s)  # each cycle asks two times
    assert age.is_hopeless(late)


def test_the_wait_ends_after_five_seconds() -> None:
    age = DataAge()
    hopeless_s = []
    for k in range(100):
        now = state(0.1 * k, 0.56)
        assert age.problem(now, now.time_s)
        if age.is_hopeless(now):
            hopeless_s.append(now.time_s)
    assert hopeless_s[0] == pytest.approx(5.1)


def test_recent_data_restarts_the_wait() -> None:
    age = DataAge()
    for k in range(100):
        now = state(0.1 * k, 0.1 if k % 40 == 39 else 0.56)
        age.problem(now, now.time_s)
        assert not age.is_hopeless(now)


def test_a_lost_lidar_is_hopeless_at_once() -> None:
    assert DataAge().is_hopeless(state(0.0, 1.1))


@pytest.mark.parametrize(
    ("scan_age_s", "telemetry_age_s", "is_old"),
    [(0.35, 0.0, False), (0.351, 0.0, True), (0.1, 0.3, False), (0.1, 0.301, True)],
)
def test_limits_are_those_of_the_safety_case(
    scan_age_s: float, telemetry_age_s: float, *, is_old: bool
) -> None:
    assert bool(DataAge().problem(state(0.0, scan_age_s), telemetry_age_s)) is is_old
    assert not DataAge().is_hopeless(state(0.0, 1.0))
    assert LIDAR_LOST not in DataAge().problem(state(0.0, 1.0), 0.0)
