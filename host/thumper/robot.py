"""`Robot` for scripts and notebooks: drive, go to a goal, read the map.

    from thumper import Robot

    with Robot("sim://") as robot:
        robot.drive(v_m_s=0.3, duration_s=2.0)
        robot.goto(0.5, -0.5)
        print(robot.pose, robot.battery_V)

Everything happens inside the calls. Between them the robot is stationary with its motors off, however long
the script takes; the next call reads what has waited in the ports. On exit, whatever the reason, the motors
stop first.
"""

import itertools
import math
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Self
from urllib.parse import parse_qsl, urlencode

from thumper.board.messages import State, Telemetry
from thumper.common.errors import EXIT_NOT_THERE, EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2, Twist2
from thumper.common.kinematics import WheelSpeeds
from thumper.config.robot import RobotConfig, load_config, with_ports
from thumper.lidar.scan import Scan
from thumper.maps.map_server_io import map_yaml_path, save_map
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.goal import check_place
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive import tasks
from thumper.runtime.drive.tasks import Task
from thumper.runtime.drive_log import DriveLog
from thumper.runtime.drive_result import DriveResult
from thumper.runtime.loop import RobotLoop
from thumper.runtime.requests import parse_goal
from thumper.runtime.state_estimator import RobotState
from thumper.slam.saved_state import SavedSlamState, load_session, save_session

SIMULATION = "sim://"
MAX_DURATION_S = 600.0
DISARM_CYCLES = 3  # telemetry from before the disarming may still arrive
_simulation_numbers = itertools.count(1)


class Robot:
    """A robot on its ports, or a simulated one. Use it in a `with` statement."""

    def __init__(
        self,
        board: str = "",
        *,
        lidar: str = "",
        config: str | Path | None = None,
        start: Pose2 | None = None,
        session: str | Path | None = None,
    ) -> None:
        """Choose the ports; `with` opens them.

        `board` is a port or "sim://", which simulates a new robot and its lidar; options follow after "?"
        ("sim://?world=hall&seed=3"). The default ports are those of the `config` file. `start` is the robot's
        pose at the start and defines the map frame; by default it is the origin. With a `session` file, the
        robot resumes mapping in that map, once it has localized near `start`, by default anywhere.

        Raises
        ------
        ThumperError
            An argument or the configuration is wrong.
        """
        if not (isinstance(board, str) and isinstance(lidar, str)):
            raise ThumperError(
                'Robot: board and lidar are port names, such as "/dev/ttyUSB0"', exit_code=EXIT_USAGE
            )
        if not (start is None or isinstance(start, Pose2)):
            raise ThumperError(
                "Robot: start is a thumper.common.geometry.Pose2(x_m=, y_m=, theta_rad=)",
                exit_code=EXIT_USAGE,
            )
        if start is not None:
            check_place("Robot: start", start.x_m, start.y_m)
        self._config = _on_ports(load_config(_path("config", config) if config else None), board, lidar)
        self._session = _path("session", session) if session else None
        self._start = start if start or session else Pose2()
        self._stack = ExitStack()
        self._robot_loop: RobotLoop | None = None

    def __enter__(self) -> Self:
        """Open the ports and map the first scans; raise ThumperError if board or lidar do not answer."""
        with ExitStack() as stack:
            size_m = self._config.mapping.resolution_m
            known = load_session(self._session, size_m) if self._session else None
            self._robot_loop = stack.enter_context(open_robot(self._config, self._start, known))
            self._loop.wait_for_map()
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._robot_loop = None
        self._stack.close()

    def drive(self, *, v_m_s: float = 0.0, w_rad_s: float = 0.0, duration_s: float = 1.0) -> None:
        """Drive at this speed (forward, counter-clockwise) for `duration_s`, then stop. Ignores obstacles.

        Raises
        ------
        ThumperError
            An invalid number, or the board has stopped the motors; the message says why.
        """
        v_m_s, w_rad_s = _number("drive", v_m_s), _number("drive", w_rad_s)
        duration_s = _duration_s("drive", duration_s)
        limit = self._config.service
        if abs(v_m_s) > limit.manual_v_max_m_s or abs(w_rad_s) > limit.manual_w_max_rad_s:
            raise ThumperError(
                f"drive: {v_m_s:g} m/s, {w_rad_s:g} rad/s is too fast; at most {limit.manual_v_max_m_s:g} m/s"
                f" and {limit.manual_w_max_rad_s:g} rad/s ([service] in the configuration)",
                exit_code=EXIT_USAGE,
            )
        if not (math.isfinite(v_m_s) and math.isfinite(w_rad_s)):
            raise ThumperError("drive: pass finite speeds", exit_code=EXIT_USAGE)
        result = self._run(tasks.cruise(Twist2(v_m_s=v_m_s, w_rad_s=w_rad_s), duration_s))
        self._await_motors_off()
        if not result.reached:
            raise ThumperError(f"the drive ended early: {result.reason}")

    def goto(
        self, x_m: float, y_m: float, heading_rad: float | None = None, *, tolerance_m: float = 0.1
    ) -> DriveResult:
        """Plan a path to a place in the map, drive there around obstacles and return the result.

        Time and path length are those of this drive. `tolerance_m` is 0.02...1.

        Raises
        ------
        ThumperError
            Before anything moves: a goal in a wall or out of reach, a latched fault, an invalid number.
        """
        numbers = {"x_m": x_m, "y_m": y_m, "tolerance_m": tolerance_m}
        if heading_rad is not None:
            numbers["yaw_rad"] = heading_rad
        numbers = {name: _number("goto", value) for name, value in numbers.items()}
        result = self._run(tasks.drive_to_goal(parse_goal(numbers)))
        self._await_motors_off()
        return result

    def wait(self, duration_s: float = 1.0) -> None:
        """Stay stationary and continue mapping for a while.

        Raises
        ------
        ThumperError
            An invalid duration, or the board is silent.
        """
        duration_s = _duration_s("wait", duration_s)
        result = self._run(tasks.wait(duration_s))
        if not result.reached:
            raise ThumperError(result.reason, exit_code=EXIT_NOT_THERE)

    @property
    def pose(self) -> Pose2:
        """The robot's pose in the map."""
        self._catch_up()
        return self._state.map_from_base

    @property
    def map(self) -> OccupancyGrid:
        """The map so far."""
        self._catch_up()
        return self._loop.mapper.grid()

    @property
    def scan(self) -> Scan:
        """The newest scan."""
        self._catch_up()
        scan = self._loop.inputs.newest_scan
        assert scan is not None  # the first scans came with __enter__
        return scan

    @property
    def telemetry(self) -> Telemetry:
        """The newest telemetry of the board, in its own units."""
        self._catch_up()
        telemetry = self._loop.inputs.telemetry
        assert telemetry is not None
        return telemetry

    @property
    def wheel_speeds(self) -> WheelSpeeds:
        """The measured wheel speeds."""
        telemetry = self.telemetry
        return WheelSpeeds(
            left_rad_s=telemetry.left_speed / 1000.0, right_rad_s=telemetry.right_speed / 1000.0
        )

    @property
    def battery_V(self) -> float:
        """The battery voltage [V]."""
        return self.telemetry.battery_mV / 1000.0

    @property
    def log(self) -> DriveLog:
        """Wheel speeds since the start, poses and plans of all `goto` calls, as arrays."""
        return self._loop.log

    def save_map(self, path: str | Path) -> Path:
        """Write PATH.yaml and PATH.pgm in map_server's format and PATH.session; return the first.

        `path` may end in .yaml; any other suffix becomes part of the name.

        Raises
        ------
        ThumperError
            It is not a path, or cannot be written.
        """
        yaml_path = map_yaml_path(_path("save_map", path))
        save_map(self.map, yaml_path)
        state = SavedSlamState.from_mapper(self._loop.mapper, self.pose)
        save_session(state, yaml_path.with_suffix(".session"))
        return yaml_path

    @property
    def _loop(self) -> RobotLoop:
        if self._robot_loop is None:
            raise ThumperError("the robot is not open; use `with Robot(...) as robot:`", exit_code=EXIT_USAGE)
        return self._robot_loop

    @property
    def _state(self) -> RobotState:
        state = self._loop.inputs.estimator.state()
        assert state is not None
        return state

    def _catch_up(self) -> None:
        self._loop.wait_for_map()

    def _run(self, task: Task) -> DriveResult:
        """Carry out a task; raise KeyboardInterrupt, as any Python code would, if Ctrl-C ended it."""
        result = self._loop.run(task)
        if result.interrupted:
            raise KeyboardInterrupt
        return result

    def _await_motors_off(self) -> None:
        """Wait until telemetry shows the motors off; if the board is silent, the next call reports it."""
        if not self._are_motors_off():
            with suppress(ThumperError):
                self._run(tasks.wait_until(self._are_motors_off, max_cycles=DISARM_CYCLES))

    def _are_motors_off(self) -> bool:
        telemetry = self._loop.inputs.telemetry
        return telemetry is None or telemetry.state in (State.DISARMED, State.FAULT)


def _number(what: str, value: float) -> float:
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise ThumperError(f"{what}: {value!r} is not a number", exit_code=EXIT_USAGE) from error


def _duration_s(what: str, value: float) -> float:
    duration_s = _number(what, value)
    if not 0.0 < duration_s <= MAX_DURATION_S:  # also refuses nan
        raise ThumperError(
            f"{what}: choose a duration of more than 0 and up to {MAX_DURATION_S:g} s", exit_code=EXIT_USAGE
        )
    return duration_s


def _path(what: str, value: str | Path) -> Path:
    if not isinstance(value, str | Path) or "\0" in str(value):
        raise ThumperError(f"{what}: {value!r} is not a file path", exit_code=EXIT_USAGE)
    return Path(value)


def _on_ports(config: RobotConfig, board: str, lidar: str) -> RobotConfig:
    if not board.startswith(SIMULATION):
        return with_ports(config, board=board, lidar=lidar)
    rest = board.removeprefix(SIMULATION)
    if rest and not rest.startswith("?"):
        return with_ports(config, board=board, lidar=lidar)  # a named simulation, as for the commands
    if lidar:
        raise ThumperError(f"Robot: {SIMULATION} has its own lidar; leave out {lidar}", exit_code=EXIT_USAGE)
    options = parse_qsl(rest.removeprefix("?"), keep_blank_values=True)
    if "lidar" not in dict(options):
        options.append(("lidar", config.lidar.model))
    name = f"{SIMULATION}robot{next(_simulation_numbers)}"
    return with_ports(config, board=f"{name}/board?{urlencode(options)}", lidar=f"{name}/lidar")
