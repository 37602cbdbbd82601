"""`Robot` for scripts and notebooks: drive, go to a goal, read the map.

    from thumper import Robot

    with Robot("sim://") as robot:
        robot.drive(v_m_s=0.3, duration_s=2.0)
        robot.goto(0.5, -0.5)
        print(robot.pose, robot.battery_V)

Everything happens within the calls: between them the robot stands, its motors off, however long the script
thinks. What waited in the ports meanwhile is taken in by the next call or question. On the way out, whatever
the reason, the motors are stopped first.
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
from thumper.runtime.drive.drive_manager import DriveMode
from thumper.runtime.drive_log import DriveLog
from thumper.runtime.drive_result import DriveResult
from thumper.runtime.loop import RobotLoop
from thumper.runtime.requests import parse_goal
from thumper.runtime.state_estimator import RobotState
from thumper.slam.saved_state import SavedSlamState, load_session, save_session

SIMULATION = "sim://"
MAX_DURATION_S = 600.0
DISARM_CYCLES = 3  # telemetry from before the motors were switched off may still be on its way
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
        """Name the ports; they are opened by `with`.

        `board` is a port or "sim://", which simulates a new robot and its lidar; what follows "sim://?" sets
        the simulation up ("sim://?world=hall&seed=3"). Without ports those of the `config` file are taken.
        The map's frame is laid by `start`, where the robot stands; by default its origin. With the file of a
        `session` the robot goes on in that map, once it has found out where in it it stands: near `start`, by
        default anywhere.

        Raises
        ------
        ThumperError
            An argument or the configuration is wrong.
        """
        if not (isinstance(board, str) and isinstance(lidar, str)):
            raise ThumperError(
                'Robot: board and lidar are names of ports, such as "/dev/ttyUSB0"', exit_code=EXIT_USAGE
            )
        if not (start is None or isinstance(start, Pose2)):
            raise ThumperError(
                "Robot: start is a thumper.geometry.Pose2(x_m=, y_m=, theta_rad=)", exit_code=EXIT_USAGE
            )
        if start is not None:
            check_place("Robot: start", start.x_m, start.y_m)
        self._config = _on_ports(load_config(_path("config", config) if config else None), board, lidar)
        self._session = _path("session", session) if session else None
        self._start = start if start or session else Pose2()
        self._stack = ExitStack()
        self._opened: RobotLoop | None = None

    def __enter__(self) -> Self:
        """Open the ports and look round; raises ThumperError when board or lidar do not answer."""
        with ExitStack() as stack:
            size_m = self._config.mapping.resolution_m
            known = load_session(self._session, size_m) if self._session else None
            self._opened = stack.enter_context(open_robot(self._config, self._start, known))
            self._runtime.inputs.wait_for_map(self._step)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._opened = None
        self._stack.close()

    def drive(self, *, v_m_s: float = 0.0, w_rad_s: float = 0.0, duration_s: float = 1.0) -> None:
        """Drive at this speed (forward, counter-clockwise) for so long, then stop. It heeds no wall.

        Raises
        ------
        ThumperError
            A number that cannot be, or the board has stopped the motors; the message says why.
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
            raise ThumperError("drive: give finite speeds", exit_code=EXIT_USAGE)
        self._catch_up()
        drive_manager = self._runtime.drive_manager
        drive_manager.arm(self._runtime.inputs.telemetry)
        try:
            drive_manager.cruise(Twist2(v_m_s=v_m_s, w_rad_s=w_rad_s))
            self._run_for(duration_s, while_armed=True)
        finally:
            self._runtime.stop()
            self._await_motors_off()

    def goto(
        self, x_m: float, y_m: float, heading_rad: float | None = None, *, tolerance_m: float = 0.1
    ) -> DriveResult:
        """Plan a way to a place in the map and drive there, round what stands in it; tells how it went.

        The result's time and way are those of this drive. `tolerance_m` is 0.02...1.

        Raises
        ------
        ThumperError
            Before anything moves: a goal in a wall or out of reach, a latched fault, a number that cannot be.
        """
        numbers = {"x_m": x_m, "y_m": y_m, "tolerance_m": tolerance_m}
        if heading_rad is not None:
            numbers["yaw_rad"] = heading_rad
        numbers = {name: _number("goto", value) for name, value in numbers.items()}
        result = self._runtime.drive_to(parse_goal(numbers), lambda _progress: None)
        self._await_motors_off()
        if result.interrupted:
            raise KeyboardInterrupt
        return result

    def wait(self, duration_s: float = 1.0) -> None:
        """Stand and go on looking and mapping for a while.

        Raises
        ------
        ThumperError
            A duration that cannot be, or the board is silent.
        """
        duration_s = _duration_s("wait", duration_s)
        self._catch_up()
        self._run_for(duration_s, while_armed=False)

    @property
    def pose(self) -> Pose2:
        """Where the robot is in the map."""
        self._catch_up()
        return self._robot_state.map_from_base

    @property
    def map(self) -> OccupancyGrid:
        """The map so far."""
        self._catch_up()
        return self._runtime.mapper.grid()

    @property
    def scan(self) -> Scan:
        """The lidar's newest turn."""
        self._catch_up()
        scan = self._runtime.inputs.newest_scan
        assert scan is not None  # the robot has looked round
        return scan

    @property
    def telemetry(self) -> Telemetry:
        """What the board says, in its own units."""
        self._catch_up()
        telemetry = self._runtime.inputs.telemetry
        assert telemetry is not None
        return telemetry

    @property
    def wheel_speeds(self) -> WheelSpeeds:
        """What the wheels do."""
        telemetry = self.telemetry
        return WheelSpeeds(
            left_rad_s=telemetry.left_speed / 1000.0, right_rad_s=telemetry.right_speed / 1000.0
        )

    @property
    def battery_V(self) -> float:
        """The battery's voltage."""
        return self.telemetry.battery_mV / 1000.0

    @property
    def log(self) -> DriveLog:
        """Wheel speeds since the beginning, poses and plans of all `goto`, as arrays."""
        return self._runtime.log

    def save_map(self, path: str | Path) -> Path:
        """Write the map as map_server's PATH.yaml and PATH.pgm, and PATH.session; returns the first.

        `path` may end in .yaml; any other ending is a part of the name.

        Raises
        ------
        ThumperError
            It is no path, or cannot be written.
        """
        yaml_path = map_yaml_path(_path("save_map", path))
        save_map(self.map, yaml_path)
        state = SavedSlamState.from_mapper(self._runtime.mapper, self.pose)
        save_session(state, yaml_path.with_suffix(".session"))
        return yaml_path

    @property
    def _runtime(self) -> RobotLoop:
        if self._opened is None:
            raise ThumperError(
                "the robot is not open: use it in `with Robot(...) as robot:`", exit_code=EXIT_USAGE
            )
        return self._opened

    @property
    def _robot_state(self) -> RobotState:
        state = self._runtime.inputs.estimator.state()
        assert state is not None
        return state

    def _catch_up(self) -> None:
        self._runtime.inputs.catch_up(self._step)

    def _await_motors_off(self) -> None:
        """Let `telemetry` be of the robot at rest; should the board be silent, the next call says so."""
        with suppress(ThumperError):
            for _ in range(DISARM_CYCLES):
                telemetry = self._runtime.inputs.telemetry
                if telemetry is None or telemetry.state in (State.DISARMED, State.FAULT) or not self._step():
                    return

    def _run_for(self, duration_s: float, *, while_armed: bool) -> None:
        until_s = math.inf
        while self._robot_state.time_s < until_s:
            if not self._step():
                raise ThumperError("the board went silent; is the cable loose?", exit_code=EXIT_NOT_THERE)
            if while_armed and self._runtime.drive_manager.mode is DriveMode.IDLE:
                raise ThumperError(f"the drive ended early: {self._runtime.drive_manager.reason}")
            until_s = min(until_s, self._robot_state.time_s + duration_s)  # from the first order on

    def _step(self) -> bool:
        alive, _ = self._runtime.step()
        return alive


def _number(what: str, value: float) -> float:
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise ThumperError(f"{what}: {value!r} is no number", exit_code=EXIT_USAGE) from error


def _duration_s(what: str, value: float) -> float:
    duration_s = _number(what, value)
    if not 0.0 < duration_s <= MAX_DURATION_S:  # nor is nan
        raise ThumperError(
            f"{what}: give a duration of more than 0 and up to {MAX_DURATION_S:g} s", exit_code=EXIT_USAGE
        )
    return duration_s


def _path(what: str, value: str | Path) -> Path:
    if not isinstance(value, str | Path) or "\0" in str(value):
        raise ThumperError(f"{what}: {value!r} is no path of a file", exit_code=EXIT_USAGE)
    return Path(value)


def _on_ports(config: RobotConfig, board: str, lidar: str) -> RobotConfig:
    if not board.startswith(SIMULATION):
        return with_ports(config, board=board, lidar=lidar)
    rest = board.removeprefix(SIMULATION)
    if rest and not rest.startswith("?"):
        return with_ports(config, board=board, lidar=lidar)  # a simulation with a name, as commands take it
    if lidar:
        raise ThumperError(
            f"Robot: {SIMULATION} brings its own lidar; leave out {lidar}", exit_code=EXIT_USAGE
        )
    options = parse_qsl(rest.removeprefix("?"), keep_blank_values=True)
    if "lidar" not in dict(options):
        options.append(("lidar", config.lidar.model))
    name = f"{SIMULATION}robot{next(_simulation_numbers)}"
    return with_ports(config, board=f"{name}/board?{urlencode(options)}", lidar=f"{name}/lidar")
