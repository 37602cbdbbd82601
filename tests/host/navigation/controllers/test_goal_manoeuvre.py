"""The way to a goal beside a wall: bends are driven slowly, and what is refused is planned again."""

import numpy as np
import pytest

from thumper.common.geometry import Pose2, Twist2
from thumper.common.resumable import Search
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.controllers.goal_manoeuvre import BLOCKED_CYCLES, GoalManoeuvre
from thumper.navigation.controllers.tight_passage import PoseSequenceFollower, TightPassageOptions
from thumper.navigation.costmap.costmap import CostmapOptions, build_costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.goal_poses import GoalPoses
from thumper.navigation.planners.lattice import LatticeOptions, LatticePlanner
from thumper.navigation.planners.traversal_cost import TraversalCostOptions
from thumper.navigation.speed_limits import SpeedLimits

WALL_Y_M = -1.0
GOAL = Goal(x_m=0.5, y_m=WALL_Y_M + 0.14)


def request_at(pose: Pose2, last_command: Twist2 | None = None) -> ControlRequest:
    cells = np.zeros((160, 160), np.int8)
    cells[:40] = 100
    grid = OccupancyGrid(cells=cells, resolution_m=0.025, origin_x_m=-2.0, origin_y_m=-2.0)
    return ControlRequest(
        map_from_base=pose,
        twist=Twist2(),
        last_command=last_command or Twist2(),
        path_m=np.array(((0.0, 0.0), (0.5, -0.9))),
        costmap=build_costmap(grid, np.empty((0, 2)), Footprint(), CostmapOptions()),
        v_limit_m_s=0.4,
        period_s=0.1,
    )


@pytest.fixture
def follower() -> PoseSequenceFollower:
    lattice = LatticePlanner(LatticeOptions(), TraversalCostOptions(), Footprint())
    return PoseSequenceFollower(TightPassageOptions(), SpeedLimits(), Footprint(), lattice)


def begun(
    follower: PoseSequenceFollower, start: Pose2, goal: Goal = GOAL
) -> tuple[GoalManoeuvre, ControlResult]:
    """Return a manoeuvre that has planned its way, and its first motion."""
    manoeuvre = GoalManoeuvre(follower, Footprint())
    for _ in range(50):
        result = manoeuvre.compute_command(request_at(start), goal)
        if result is not None and result.command not in (None, Twist2()):
            return manoeuvre, result
    raise AssertionError("no way was found")


def test_refused_motion_is_planned_again(follower: PoseSequenceFollower) -> None:
    """Whoever refuses it, the robot does not ask for the same motion for ever."""
    start = Pose2(x_m=0.2, y_m=-0.5)
    manoeuvre, _ = begun(follower, start)
    for _ in range(BLOCKED_CYCLES + 1):
        assert follower.active
        manoeuvre.compute_command(request_at(start), GOAL)
    assert manoeuvre.active
    assert not follower.active


@pytest.mark.parametrize(
    ("heading_rad", "off_m", "arrives"), [(None, 0.03, True), (None, 0.12, False), (0.0, 0.03, False)]
)
def test_robot_that_fits_at_the_goal_does_not_turn_there(
    follower: PoseSequenceFollower, heading_rad: float | None, off_m: float, arrives: bool
) -> None:
    """The planned poses may end in another heading than the robot has; any will do if none is wanted."""
    goal = Goal(x_m=0.5, y_m=WALL_Y_M + 0.25, theta_rad=heading_rad)
    manoeuvre, _ = begun(follower, Pose2(x_m=0.2, y_m=-0.5), goal)
    there = Pose2(x_m=goal.x_m - off_m, y_m=goal.y_m, theta_rad=0.4)
    result = manoeuvre.compute_command(request_at(there, last_command=Twist2(v_m_s=0.1)), goal)
    assert result is not None
    assert manoeuvre.arrived is arrives
    assert (result.command == Twist2()) is arrives


def test_motion_under_way_is_not_refused(follower: PoseSequenceFollower) -> None:
    start = Pose2(x_m=0.2, y_m=-0.5)
    manoeuvre, result = begun(follower, start)
    for _ in range(3 * BLOCKED_CYCLES):
        assert result.command is not None
        step = manoeuvre.compute_command(request_at(start, last_command=Twist2(w_rad_s=-0.3)), GOAL)
        assert step is not None
        result = step
    assert follower.active


def test_robot_off_its_heading_turns_on_the_spot(follower: PoseSequenceFollower) -> None:
    """Beside a wall a correction on the way would bring a corner into it."""

    def end() -> Search[GoalPoses]:
        yield
        return GoalPoses(np.array(((0.7, -0.2, 0.0),)), np.zeros(1))

    asked = request_at(Pose2(y_m=-0.2))
    follower.plan_to(asked, asked.costmap, end())
    while follower.advance() is None:
        pass
    result = follower.compute_command(request_at(Pose2(x_m=0.3, y_m=-0.2, theta_rad=0.3)))
    assert result is not None
    assert result.command is not None
    assert result.command.v_m_s == 0.0
    assert result.command.w_rad_s < 0.0


def test_robot_is_slow_where_the_path_bends(follower: PoseSequenceFollower) -> None:
    """It begins to brake on the straight before."""
    straight = np.column_stack((np.linspace(-0.8, 0.0, 17), np.full(17, 0.6), np.zeros(17)))
    along = np.linspace(0.05, 0.3, 5)
    bend = np.column_stack((along, np.full(5, 0.6), 0.8 * along / 0.3))
    follower._poses, follower._whole, follower.active = np.vstack((straight, bend)), True, True
    x_m, command, fastest_m_s = -0.8, Twist2(), 0.0
    while x_m < 0.0:
        result = follower.compute_command(request_at(Pose2(x_m=x_m, y_m=0.6), last_command=command))
        assert result is not None
        assert result.command is not None
        command = result.command
        x_m += 0.1 * command.v_m_s
        fastest_m_s = max(fastest_m_s, command.v_m_s)
    assert fastest_m_s > 0.25
    assert command.v_m_s < 0.16  # the last cycle before the bend; 0.12 in it


def test_correction_of_the_heading_ends_at_the_heading(follower: PoseSequenceFollower) -> None:
    """A turn that follows later, after a drive, does not make it faster."""
    speeds = []
    for later in ((), ((0.7, -0.2, 1.5),)):
        follower._poses = np.array(((0.0, -0.2, 0.0), (0.7, -0.2, 0.0), *later))
        follower._whole, follower._index, follower.active = True, 0, True
        pose = Pose2(x_m=0.3, y_m=-0.2, theta_rad=-0.17)
        result = follower.compute_command(request_at(pose, last_command=Twist2(w_rad_s=1.2)))
        assert result is not None
        assert result.command is not None
        speeds.append(result.command.w_rad_s)
    assert speeds[0] == speeds[1]


def test_waiting_for_a_person_is_not_refused(follower: PoseSequenceFollower) -> None:
    start = Pose2(x_m=0.2, y_m=-0.5)
    manoeuvre, _ = begun(follower, start)
    for _ in range(100):
        manoeuvre.on_yielding()
        assert manoeuvre.compute_command(request_at(start), GOAL) is not None
    assert follower.active
