"""Tracks: people keep their track when they turn round, and are predicted up to walls and back."""

import math

import numpy as np
import pytest

from thumper.common.geometry import FloatArray, Pose2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions, build_costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.safety.dynamic_obstacles import MovingObject, SmallObject
from thumper.navigation.safety.tracks import AGE_S, STEP_S, STRIDE_M, Tracks

LIDAR = Pose2()
ARC = np.linspace(0.5 * math.pi, 1.5 * math.pi, 15)


def disc_m(x_m: float, y_m: float, radius_m: float = 0.2) -> FloatArray:
    """Return the points of a disc's side toward the lidar."""
    return np.column_stack((x_m + radius_m * np.cos(ARC), y_m + radius_m * np.sin(ARC)))


def walked(y_m: list[float], *, legs: bool = False) -> Tracks:
    """Return the tracks after somebody was at these places, one per scan, 2 m ahead."""
    tracks = Tracks(least_m_s=0.25)
    for cycle, y in enumerate(y_m):
        swing_m = 0.3 * math.sin(math.pi * 0.1 * cycle / 0.65)
        parts = [disc_m(2.0, y)]
        if legs:
            parts = [disc_m(1.9, y - swing_m, 0.06), disc_m(2.1, y + swing_m, 0.06)]
        post = SmallObject(disc_m(2.4, -0.9, 0.05), True)
        small = [post, *(SmallObject(part, False) for part in parts)]
        moving = [MovingObject(parts[0], np.array((0.0, 1.0)))] if cycle == 0 else []
        tracks.update(0.1 * cycle, LIDAR, small, moving)
    return tracks


def wall_at(y_m: float) -> Costmap:
    grid = OccupancyGrid(cells=np.zeros((160, 160), np.int8), resolution_m=0.05, origin_x_m=-4, origin_y_m=-4)
    wall_m = np.column_stack((np.arange(-4.0, 4.0, 0.05), np.full(160, y_m)))
    return build_costmap(grid, wall_m, Footprint(), CostmapOptions())


def middles(discs: FloatArray) -> FloatArray:
    """Return the middles between the two discs of each prediction, shape (n, STEPS, 2)."""
    return 0.5 * (discs[:, ::2, :2] + discs[:, 1::2, :2]).transpose(1, 0, 2)


UP = list(np.arange(-1.0, 0.55, 0.1))


@pytest.mark.parametrize("legs", [False, True], ids=["disc", "legs"])
def test_follows_somebody_who_walks(legs: bool) -> None:
    (track,) = walked(UP, legs=legs).tracks
    assert track.centre_m == pytest.approx((2.0, 0.5), abs=0.12)
    assert track.velocity_m_s == pytest.approx((0.0, 1.0), abs=0.3 if legs else 0.1)


def test_outlines_of_who_walks_are_where_they_are_and_move_as_they_do() -> None:
    (outline,) = walked(UP, legs=True).outlines()
    (track,) = walked(UP, legs=True).tracks
    assert outline.points_m.mean(axis=0) == pytest.approx(track.centre_m)
    reach_m = np.hypot(*(outline.points_m - track.centre_m).T).max()
    assert reach_m == pytest.approx(track.radius_m + STRIDE_M, abs=0.02)
    assert outline.velocity_m_s == pytest.approx((0.0, 1.0), abs=0.3)
    assert walked([0.0] * 30).outlines() == []


def test_how_somebody_walks_is_unknown_in_their_first_scans() -> None:
    beside, far = np.array((1.2, -1.0)), np.array((0.0, 0.0))
    for scans, unknown in ((1, True), (3, True), (4, False)):
        tracks = walked(UP[:scans])
        assert tracks.has_unknown_near(beside) is unknown
        assert not tracks.has_unknown_near(far)


def test_keeps_the_track_of_somebody_who_turns_round() -> None:
    (track,) = walked(UP + UP[::-1][:8]).tracks
    assert track.velocity_m_s == pytest.approx((0.0, -1.0), abs=0.3)
    assert track.walk_m_s == pytest.approx((0.0, -1.0), abs=0.3)


def test_legs_that_turn_round_stay_one_track() -> None:
    (track,) = walked(UP + UP[::-1], legs=True).tracks
    assert track.centre_m == pytest.approx((2.0, -1.0), abs=0.2)
    assert track.velocity_m_s == pytest.approx((0.0, -1.0), abs=0.4)


def test_who_stands_is_no_longer_in_the_way_after_a_while() -> None:
    tracks = walked(UP + [0.5] * 10)
    assert len(tracks.moving()) == 1  # may turn round
    assert not tracks.are_near(np.array(((2.0, 0.5),))).any()
    tracks = walked(UP + [0.5] * 30)
    assert not tracks.moving()
    assert not walked(UP + [0.5] * 70).tracks


def test_is_predicted_to_stop_at_a_wall_or_to_turn_round() -> None:
    stops, turns, early = middles(walked(UP).predicted(wall_at(2.0)))
    at_wall = round(1.3 / STEP_S)
    for way in (stops, turns):
        assert way[4] == pytest.approx((2.0, 0.5 + AGE_S + 5 * STEP_S), abs=0.12)
    assert stops[-1, 1] == pytest.approx(1.75, abs=0.15)
    assert turns[2 * at_wall, 1] < stops[-1, 1] - 0.8
    assert early[:, 1].max() < turns[:, 1].max() - 0.2


def test_in_the_open_there_is_one_prediction() -> None:
    discs = walked(UP).predicted(wall_at(-3.0))
    assert len(middles(discs)) == 1
    assert discs[0, 1, 1] - discs[0, 0, 1] == pytest.approx(2.0 * STRIDE_M, abs=0.01)  # both legs


@pytest.mark.parametrize(("pause_s", "count"), [(0.5, 1), (3.0, 0)])
def test_a_pause_ends_the_tracks_even_if_something_stands_where_they_would_be(
    pause_s: float, count: int
) -> None:
    tracks = walked(UP)
    (track,) = tracks.tracks
    x_m, y_m = track.centre_m + track.velocity_m_s * pause_s
    there = SmallObject(disc_m(x_m, y_m), False)
    tracks.update(0.1 * (len(UP) - 1) + pause_s, LIDAR, [there], [])
    assert len(tracks.tracks) == count


@pytest.mark.parametrize(
    ("y_m", "count"), [(0.6, 0), (1.2, 1), (1.6, 0)], ids=["own leg", "beside it", "a track of its own"]
)
def test_somebody_beside_a_track_is_untracked(y_m: float, count: int) -> None:
    tracks = walked(UP)
    beside = MovingObject(disc_m(2.0, y_m, 0.06), np.array((-1.0, 0.0)))
    tracks.update(0.1 * len(UP), LIDAR, [SmallObject(disc_m(2.0, 0.6), False)], [beside])
    assert len(tracks.untracked) == count


def test_who_stood_and_starts_to_walk_is_untracked() -> None:
    tracks = walked(UP + [0.5] * 30)
    starts = MovingObject(disc_m(2.0, 0.5), np.array((-1.0, 0.0)))
    tracks.update(0.1 * (len(UP) + 30), LIDAR, [SmallObject(disc_m(2.0, 0.5), True)], [starts])
    assert len(tracks.tracks) == len(tracks.untracked) == 1


def test_tracks_move_with_a_jump_of_the_map() -> None:
    """The map turns by 90 degrees: who walked up walks to the left."""
    tracks = walked(UP)
    (before,) = tracks.tracks
    centre_m, velocity_m_s = before.centre_m, before.velocity_m_s
    tracks.move(Pose2(x_m=1.0, theta_rad=0.5 * math.pi))
    (track,) = tracks.tracks
    assert track.centre_m == pytest.approx((1.0 - centre_m[1], centre_m[0]))
    assert track.velocity_m_s == pytest.approx((-velocity_m_s[1], velocity_m_s[0]))
    assert track.walk_m_s[0] < -0.3
