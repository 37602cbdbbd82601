"""How a drive through a course ends, by ground truth."""

from dataclasses import replace

import pytest

from thumper.common.geometry import Pose2
from thumper.navigation.goal import Goal
from thumper_hil.courses.course import Course, drive_course

ROOM = "[[wall]]\nclosed = true\npoints_m = [[-1.0, -1.0], [3.0, -1.0], [3.0, 1.0], [-1.0, 1.0]]\n"
PERSON = "[[person]]\nwaypoints_m = [[-0.9, 0.0], [-0.1, 0.0]]\nspeed_m_s = 1.0\nleg_radius_m = 0.06\n"
COURSE = Course(world_toml=ROOM, start=Pose2(), goal=Goal(x_m=2.0, y_m=0.0))


def test_it_ends_where_the_robot_has_arrived() -> None:
    run = drive_course(COURSE, preset="nominal", seed=0)
    assert (run.reached, run.timed_out, run.contacts, run.touches_by_people) == (True, False, 0, 0)
    assert run.goal_error_m < 0.1
    assert 0.75 < run.clearance_m < 0.85  # to the walls beside it: half of its width is 0.15 m
    assert 0.0 < run.pose_error_m < 0.05
    assert 5.0 < run.time_s < 15.0
    assert run.plans


def test_it_ends_early_at_the_true_distance_that_counts_as_arrival() -> None:
    run = drive_course(replace(COURSE, arrival_m=1.0), preset="nominal", seed=0)
    assert run.reached
    assert 0.9 < run.goal_error_m < 1.0


def test_the_time_limit_ends_it() -> None:
    run = drive_course(replace(COURSE, limit_s=2.0), preset="nominal", seed=0)
    assert (run.reached, run.timed_out) == (False, True)
    assert run.time_s == pytest.approx(2.0, abs=0.5)


def test_a_person_who_walks_into_the_robot_from_behind_ends_nothing() -> None:
    run = drive_course(replace(COURSE, world_toml=ROOM + PERSON), preset="nominal", seed=0)
    assert run.touches_by_people > 0
    assert run.contacts == 0
    assert run.reached
