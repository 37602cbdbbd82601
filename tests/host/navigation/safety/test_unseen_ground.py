"""Ground that the lidar has never seen: the robot neither backs up nor swings its tail over it."""

import math

import numpy as np
import pytest

from tests.variants import some_of
from thumper.common.geometry import Pose2
from thumper.lidar.field_of_view import FieldOfView
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.unseen_ground import UnseenGround
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationState
from thumper_hil.kinematic.closed_loop import Run, drive
from thumper_hil.kinematic.world import KinematicWorld, box

AREA = (-4.0, -4.0, 8.0, 8.0)
HALL = box(0.0, 0.0, 7.0, 7.0)
TAIL_M, SIDE_M, LEG_M = 0.21, 0.15, 0.02
NOTHING = np.empty((0, 2))  # open ground: no echo
POCKET = (box(0.45, 0.0, 0.1, 0.8), box(0.1, 0.35, 0.6, 0.1), box(0.1, -0.35, 0.6, 0.1))


def with_post(x_m: float, y_m: float, *boxes: list[list[float]]) -> KinematicWorld:
    walls = KinematicWorld.from_boxes(HALL, *boxes)
    return KinematicWorld(segments_m=walls.segments_m, circles_m=np.array(((x_m, y_m, LEG_M),)))


def drive_from_standstill(world: KinematicWorld, goal: Goal, seed: int) -> Run:
    """Drive without a map; the robot has never seen what is behind it."""
    return drive(world, Pose2(), goal, AREA, seed=seed, limit_s=60.0)


@pytest.mark.parametrize("gap_m", [0.08, pytest.param(0.20, marks=pytest.mark.slow)])
def test_does_not_back_up_over_unseen_ground(gap_m: float) -> None:
    """The robot's nose is in a pocket, and a post that it never saw is behind it."""
    world = with_post(-TAIL_M - gap_m - LEG_M, 0.0, *POCKET)
    run = drive_from_standstill(world, Goal(x_m=-2.0, y_m=0.0), 0)
    assert run.clearance_m > 0.0
    assert run.state is NavigationState.FAILED  # there is no way out that it can see
    assert "never seen" in " ".join(output.reason for output in run.outputs)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("gap_m", some_of([0.03, 0.05]))
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_does_not_swing_the_tail_into_an_unseen_chair_leg(gap_m: float, side: float, seed: int) -> None:
    """A leg beside the tail, out of view from the start; the goal is behind. It drives ahead to turn."""
    world = with_post(-TAIL_M + 0.03, side * (SIDE_M + gap_m + LEG_M))
    run = drive_from_standstill(world, Goal(x_m=-1.5, y_m=-0.5 * side), seed)
    assert run.clearance_m > 0.0
    assert run.state is NavigationState.REACHED


def unknown_window() -> OccupancyGrid:
    cells = np.full((80, 80), -1, np.int8)
    return OccupancyGrid(cells=cells, resolution_m=0.025, origin_x_m=-1.0, origin_y_m=-1.0)


def test_only_unknown_cells_near_and_out_of_view_are_unseen() -> None:
    view, footprint = FieldOfView(), Footprint()
    points_m = UnseenGround(footprint, view).update(unknown_window(), Pose2(), NOTHING)
    bearing_rad, _ = view.bearings_and_ranges(Pose2(), points_m)
    assert len(points_m)
    assert np.abs(bearing_rad).min() > math.radians(119.0)
    assert np.hypot(*points_m.T).max() < footprint.circumscribed_radius_m + 0.30
    assert (
        len(
            UnseenGround(footprint, FieldOfView(opening_rad=math.tau)).update(
                unknown_window(), Pose2(), NOTHING
            )
        )
        == 0
    )


def test_small_steps_do_not_add_up() -> None:
    """The robot turns by a degree in each cycle: what was unseen beside its tail stays unseen."""
    ground = UnseenGround(Footprint(), FieldOfView())
    first = {tuple(point) for point in ground.update(unknown_window(), Pose2(), NOTHING).round(4).tolist()}
    swept = Pose2(theta_rad=0.3).apply(np.array(((-TAIL_M, -SIDE_M),)))[0]
    leg = min(first, key=lambda point: math.dist(point, swept))
    assert math.dist(leg, swept) < 0.03
    for k in range(12):
        points_m = ground.update(unknown_window(), Pose2(theta_rad=math.radians(k)), NOTHING)
    assert leg in {tuple(point) for point in points_m.round(4).tolist()}


def test_ground_that_the_robot_stood_on_is_known_and_moves_with_the_map() -> None:
    ground, window = UnseenGround(Footprint(), FieldOfView()), unknown_window()
    ground.update(window, Pose2(), NOTHING)
    ahead, behind = Pose2(x_m=0.25), np.array((-0.15, 0.0))

    def nearest_m(points_m: np.typing.NDArray[np.float64]) -> float:
        return float(np.hypot(*(points_m - behind).T).min())

    assert nearest_m(ground.update(unknown_window(), ahead, NOTHING)) > 0.05
    ground.move(Pose2(y_m=0.5))
    assert nearest_m(ground.update(unknown_window(), ahead, NOTHING)) < 0.03


def test_ground_where_several_scans_found_nothing_is_seen() -> None:
    """On open ground no echo returns. After some way ahead the robot may turn."""
    ground, base = UnseenGround(Footprint(), FieldOfView()), Pose2()
    assert ground.move_ahead_m(ground.update(unknown_window(), base, NOTHING), base) > 0.0
    for k in range(14):
        base = Pose2(x_m=0.05 * k)
        points_m = ground.update(unknown_window(), base, NOTHING)
    assert ground.move_ahead_m(points_m, base) == 0.0
    ground.move(Pose2(x_m=1.5))  # what was seen moves with the map
    assert ground.move_ahead_m(ground.update(unknown_window(), base, NOTHING), base) > 0.0


def test_ground_behind_an_obstacle_stays_unseen() -> None:
    """A box beside the way hides the ground behind it from every scan."""
    ground = UnseenGround(Footprint(), FieldOfView())
    front_m = np.column_stack((np.linspace(-0.3, 0.9, 121), np.full(121, -0.3)))
    for k in range(14):
        base = Pose2(x_m=0.05 * k)
        points_m = ground.update(unknown_window(), base, front_m)
    beside_m = points_m[np.hypot(*(points_m - (base.x_m, base.y_m)).T) < 0.4]
    assert len(beside_m) > 0
    assert beside_m[:, 1].max() < -0.3


@pytest.mark.parametrize(
    ("poses", "is_seen"),
    [
        ([Pose2(theta_rad=math.pi)], False),
        ([Pose2(theta_rad=math.pi + 0.1 * k) for k in range(5)], False),  # the lidar hardly moves
        ([Pose2(x_m=0.1 * k, theta_rad=math.pi) for k in range(2)], False),
        ([Pose2(x_m=0.1 * k, theta_rad=math.pi) for k in range(3)], True),
    ],
    ids=["one look", "turning on the spot", "two places", "three places"],
)
def test_ground_is_seen_from_three_places(poses: list[Pose2], is_seen: bool) -> None:
    ground, behind_m = UnseenGround(Footprint(), FieldOfView()), np.array((-0.25, 0.0))
    for pose in poses:
        ground.update(unknown_window(), pose, NOTHING)
    closed_m = ground.update(unknown_window(), Pose2(x_m=0.01), NOTHING)
    assert bool((np.hypot(*(closed_m - behind_m).T) < 0.03).any()) is not is_seen


def test_one_scan_is_one_look() -> None:
    """Cycles between two scans show nothing new."""
    ground, scan_pose = UnseenGround(Footprint(), FieldOfView()), Pose2(theta_rad=math.pi)
    for k in range(4):
        ground.update(unknown_window(), Pose2(x_m=-0.1 * k, theta_rad=math.pi), NOTHING, scan_pose)
    closed_m = ground.update(unknown_window(), Pose2(x_m=0.3), NOTHING, scan_pose)
    assert len(closed_m) > 0
