"""Drive through a course: the whole robot with its firmware, lidar and SLAM, as hard as a preset says.

The robot starts without a map, unless the course says that it has one. It plans with the pose that it
estimates. The outcome is judged by ground truth.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import urlencode

import numpy as np

from thumper.board.options import BoardOptions
from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray, Pose2
from thumper.config.robot import RobotConfig
from thumper.lidar.options import LidarOptions
from thumper.navigation.goal import Goal
from thumper.navigation.options import NavigationOptions
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.tasks import drive_to_goal
from thumper_hil.bench.bench import Bench
from thumper_hil.bench.collision import FOOTPRINT_M
from thumper_hil.bench.registry import forget_simulation, simulation
from thumper_hil.world.world import World

NAME = "course"


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """A world as the text of its TOML file, where the robot starts, and where it should go."""

    world_toml: str
    start: Pose2
    goal: Goal
    limit_s: float = 100.0
    arrival_m: float = 0.0
    """The drive ends at this true distance from the goal; 0: where the robot says that it has arrived."""

    has_map: bool = False
    """The robot has a true map, and localizes in it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseRun:
    """What happened in a drive."""

    reached: bool
    """By ground truth if the course has an `arrival_m`, otherwise as the robot says."""

    reason: str
    time_s: float
    goal_error_m: float
    clearance_m: float
    """The least distance between outline and fixed obstacles."""

    contacts: int
    """The robot touched an obstacle, or drove into a person; the first ends the drive."""

    touches_by_people: int
    """A person walked into the robot."""

    pose_error_m: float
    """Root of the mean square distance between estimated and true position."""

    plans: list[FloatArray]

    track: FloatArray
    """True time, x, y and heading of the drive, shape (n, 4)."""

    @property
    def timed_out(self) -> bool:
        """Whether the time limit ended the drive."""
        return self.reason == _TOO_LATE


_TOO_LATE, _ARRIVED, _CONTACT = "the time is over", "arrived", "the robot touched something"


def drive_course(
    course: Course, *, preset: str, seed: int, navigation: NavigationOptions | None = None
) -> CourseRun:
    """Drive with a new robot to the goal of a course."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "course.toml"
        path.write_text(course.world_toml, encoding="utf-8")
        options = {
            "world": path,
            "x_m": course.start.x_m,
            "y_m": course.start.y_m,
            "yaw_deg": math.degrees(course.start.theta_rad),
            "seed": seed,
            "preset": preset,
        }
        config = RobotConfig(
            board=BoardOptions(port=f"sim://{NAME}/board?{urlencode(options)}"),
            lidar=LidarOptions(port=f"sim://{NAME}/lidar"),
            navigation=navigation or NavigationOptions(),
        )
        try:
            return _drive(course, config, World.load(path))
        finally:
            forget_simulation(NAME)


def _drive(course: Course, config: RobotConfig, fixed: World) -> CourseRun:
    with open_robot(config, course.start, fixed.to_grid() if course.has_map else None) as robot:
        bench = simulation(NAME)
        referee = _Referee(course, bench)
        robot.after_cycle.append(referee.check)
        reached = False
        try:
            result = robot.run(drive_to_goal(course.goal, "course"))
            reached, reason = result.reached, result.reason
        except ThumperError as refusal:
            reason = str(refusal)
        log, truth, ended_s = robot.log, bench.truth(), referee.ended_s or bench.time_s
    estimated = log.poses
    errors_m = [
        np.interp(estimated[:, 0], truth[:, 0], truth[:, axis]) - estimated[:, axis] for axis in (1, 2)
    ]
    driven = truth[(truth[:, 0] >= referee.started_s) & (truth[:, 0] <= ended_s)]
    poses = [Pose2(x_m=x, y_m=y, theta_rad=theta) for x, y, theta in driven[:, 1:4]]
    return CourseRun(
        reached=reason == _ARRIVED if course.arrival_m else reached,
        reason=reason,
        time_s=ended_s - referee.started_s,
        goal_error_m=course.goal.distance_m(poses[-1]),
        clearance_m=min(fixed.clearance_m(pose, FOOTPRINT_M) for pose in poses[::2]),
        contacts=bench.contacts,
        touches_by_people=bench.touches_by_people,
        pose_error_m=float(np.sqrt(np.mean(np.square(errors_m).sum(axis=0)))),
        plans=log.plans,
        track=driven[:, :4],
    )


class _Referee:
    """Ends the drive, from within a control cycle, if nothing more can change its outcome."""

    def __init__(self, course: Course, bench: Bench) -> None:
        self._course, self._bench = course, bench
        self.started_s, self.ended_s = bench.time_s, 0.0

    def check(self) -> None:
        """Raise ThumperError with the reason; the robot then stops."""
        if self.ended_s:
            return
        course, reason = self._course, ""
        if self._bench.contacts:
            reason = _CONTACT
        elif course.goal.distance_m(self._bench.chip.truth().map_from_base) < course.arrival_m:
            reason = _ARRIVED
        elif self._bench.time_s - self.started_s > course.limit_s:
            reason = _TOO_LATE
        if reason:
            self.ended_s = self._bench.time_s
            raise ThumperError(reason)
