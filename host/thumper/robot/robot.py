"""`Robot` for scripts and notebooks: drive, go to a goal, read the map.

    from thumper import Robot

    with Robot("sim://") as robot:
        robot.forward(0.5)
        robot.turn(deg=-90)
        robot.goto(0.5, -0.5)
        print(robot.pose, robot.battery_V)

Everything happens inside the calls. Between them the robot is stationary with its motors off, however long
the script takes; the next call reads what has waited in the ports. On exit, whatever the reason, the motors
stop first. The map, the log and the last pose stay readable.
"""

import atexit
from collections.abc import Callable, Iterable
from contextlib import ExitStack, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Never, Self

from thumper.board.fault_texts import STATE_NAMES
from thumper.board.messages import State, Telemetry
from thumper.common.attribute_hints import HintedAttributes
from thumper.common.errors import EXIT_NOT_THERE, EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2, Twist2, wrap_angle
from thumper.common.kinematics import WheelSpeeds
from thumper.common.optional_packages import require_extra
from thumper.common.signals import forget_interrupts
from thumper.config.robot import load_config, with_ports
from thumper.lidar.scan import Scan
from thumper.maps.annotations import Annotations, annotations_path, load_annotations, save_annotations
from thumper.maps.map_server_io import load_map, map_yaml_path, save_map
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.local_model import ObstaclePoints
from thumper.navigation.goal import Goal, check_place
from thumper.robot import arguments
from thumper.robot.call_hints import with_call_hints
from thumper.robot.leg_log import LegLog
from thumper.runtime.assembly import check_ports, collision_monitor, open_robot
from thumper.runtime.drive import motions, tasks
from thumper.runtime.drive.motions import Motion
from thumper.runtime.drive.tasks import Task
from thumper.runtime.drive.waypoints import Waypoints
from thumper.runtime.drive_log import DriveLog
from thumper.runtime.drive_result import DriveResult
from thumper.runtime.loop import UNCONFIRMED, RobotLoop
from thumper.runtime.requests import GOAL_TOLERANCE_M, MAX_WAIT_S, RobotCommand
from thumper.runtime.state_estimator import RobotState
from thumper.slam.saved_state import SavedSlamState, load_session, save_session

if TYPE_CHECKING:
    from thumper.robot.figure import RobotFigure
    from thumper.robot.live_figure import LiveFigure
    from thumper.runtime.drive.docking import Docking

NEAR_M, NEAR_RAD = 0.1, 0.1
MAX_EXPLORE_MINUTES = 24 * 60
NOT_OPEN = "the robot is not open; use `with Robot(...) as robot:`, or robot.open()"
DISARM_CYCLES = 3  # telemetry from before the disarming may still arrive


@with_call_hints
class Robot(HintedAttributes):
    """A robot on its ports, or a simulated one. Use it in a `with` statement, or `open` and `close` it.

        with Robot("sim://") as robot:
            robot.forward(0.5)
            robot.goto(0.5, -0.5, heading_deg=90)
            print(robot.pose)

    All poses are in the map: x forward and y to the left of the start pose [m], angles counter-clockwise.
    `forward`, `turn`, `goto`, `patrol`, `explore`, `dock` and `undock` return a `DriveResult`. A drive that
    does not arrive raises nothing: `reached` is False and `reason` says why.
    """

    _parts: ClassVar = {"pose": Pose2, "scan": Scan, "map": OccupancyGrid}

    def __init__(
        self,
        board: str = "",
        *,
        lidar: str = "",
        config: str | Path | None = None,
        start: Pose2 | None = None,
        map: str | Path | None = None,  # noqa: A002 - the word that users expect
        session: str | Path | None = None,
    ) -> None:
        """Choose the ports; `with` or `open` opens them.

        `board` is a port or "sim://", which simulates a new robot and its lidar; options follow after "?"
        ("sim://?world=hall&seed=3"). The default ports are those of the `config` file. `start` is the robot's
        pose at the start and defines the map frame; by default it is the origin. In a saved `map` (.yaml)
        the robot localizes near `start`, by default anywhere, and leaves the map as it is. In a `session`
        file it localizes too, and continues to map.

        Raises
        ------
        ThumperError
            An argument or the configuration is wrong, or there is no such port.
        """
        if not (isinstance(board, str) and isinstance(lidar, str)):
            raise arguments.wrong("Robot", "board, lidar", 'pass names of ports, such as "/dev/ttyUSB0"')
        if not (start is None or isinstance(start, Pose2)):
            raise arguments.wrong("Robot", "start", "pass a thumper.Pose2(x_m=, y_m=, theta_rad=)")
        if start is not None:
            check_place("Robot: start:", start.x_m, start.y_m)
        if map and session:
            problem = "pass only one of them: a map stays as it is, a session continues to map"
            raise arguments.wrong("Robot", "map, session", problem)
        path = partial(arguments.file_path, "Robot")
        self._config = with_ports(
            load_config(path("config", config) if config else None), board=board, lidar=lidar
        )
        check_ports(self._config)
        self._session = path("session", session) if session else None
        self._map = path("map", map) if map else None
        self._start = start if start or session or map else Pose2()
        self._stack = ExitStack()
        self._robot_loop: RobotLoop | None = None  # stays after `close`, to be read
        self._is_open = False
        self._live_figure: LiveFigure | None = None
        self._is_busy = False  # a call runs
        self._is_stopped = False  # by `stop`, since the last call
        self._target: Pose2 | None = None  # of the last simple motion

    def __enter__(self) -> Self:
        return self.open()

    def __exit__(self, *_: object) -> None:
        self.close()

    def open(self) -> Self:
        """Open the ports and map the first scans. For a notebook, where a `with` ends with its cell.

        If kernels must be compiled first, a line on stderr says so. The end of Python closes the robot.

        Raises
        ------
        ThumperError
            Board or lidar do not answer, or the robot is open already.
        """
        if self._is_open:
            raise ThumperError("the robot is open already", exit_code=EXIT_USAGE)
        from rich.console import Console  # 0.1 s that an import of Robot need not take

        from thumper.common.compile_progress import compile_progress

        with ExitStack() as stack:
            known: OccupancyGrid | SavedSlamState | None = None
            if self._session:
                known = load_session(self._session, self._config.mapping.resolution_m)
            elif self._map:
                known = load_map(self._map)
            opened = open_robot(self._config, self._start, known, annotations=self._annotations())
            with compile_progress(Console(stderr=True, force_jupyter=False)):  # Jupyter needs a widget for it
                loop = stack.enter_context(opened)
            loop.wait_for_map()
            self._stack = stack.pop_all()
        self._robot_loop, self._is_open = loop, True
        atexit.register(self.close)
        return self

    def close(self) -> None:
        """Stop the motors and close the ports; map, log and the last values stay readable."""
        self._is_open = False
        atexit.unregister(self.close)
        self._stack.close()

    def _annotations(self) -> Annotations:
        """Return the zones and places that were saved with the map."""
        path = self._session or self._map
        return load_annotations(annotations_path(path)) if path else Annotations()

    def __repr__(self) -> str:
        port = self._config.board.port.partition("/board?")[0]  # of sim://robot1/board?lidar=ld19
        if self._robot_loop is None:
            return f"<Robot {port}: not open>"
        pose, telemetry = self._state.map_from_base, self._robot_loop.inputs.telemetry
        place = f"at ({pose.x_m:z.2f} m, {pose.y_m:z.2f} m, {pose.heading_deg:z.0f}°)"
        if not self._is_open:
            return f"<Robot {port}: closed {place}>"
        if telemetry is not None:
            place += f", {telemetry.battery_mV / 1000.0:.1f} V, {STATE_NAMES[telemetry.state.name]}"
        return f"<Robot {port} {place}>"

    def forward(self, distance_m: float, *, v_m_s: float = 0.25, unseen: bool = False) -> DriveResult:
        """Drive straight by `distance_m`, backward if negative, and return the result.

        `v_m_s` is the highest speed. The robot keeps its line by the pose in the map, and corrects its stop;
        the path length includes that. It stops before an obstacle that it sees or remembers, and does not
        back up over ground that its lidar has never seen; the result's `reason` says so. If you know that
        this ground is free, pass `unseen=True`.

        Raises
        ------
        ThumperError
            An invalid number, or the board has latched a fault.
        """
        distance_m = arguments.distance_m("forward", distance_m)
        limits = self._config.navigation.limits
        limits = replace(limits, v_max_m_s=arguments.speed("forward", "v_m_s", v_m_s, limits.v_max_m_s))
        start = self._reference()
        motion = motions.drive_on_heading(distance_m, limits, start)
        result = self._move(motion, unseen=unseen, cure="turn and look there first")
        self._target = start @ Pose2(x_m=distance_m) if result.reached else None
        return result

    def turn(
        self,
        *without_unit: Never,
        rad: float | None = None,
        deg: float | None = None,
        w_rad_s: float = 1.0,
        unseen: bool = False,
    ) -> DriveResult:
        """Turn in place, counter-clockwise if positive: `turn(deg=90)`, `turn(rad=1.57)`; return the result.

        It may be more than a full turn: `turn(deg=720)`. `w_rad_s` is the highest turn rate. Stops before
        obstacles and unseen ground as `forward` does: a robot that starts without a map has not seen the
        ground that its tail sweeps, and must first drive about 0.4 m forward.

        Raises
        ------
        ThumperError
            An invalid number, or the board has latched a fault.
        """
        angle_rad = arguments.angle_rad("turn", without_unit, rad, deg, "")
        if not angle_rad:
            raise arguments.wrong("turn", "deg, rad", "choose other than 0, such as deg=90")
        limits = self._config.navigation.limits
        limits = replace(limits, w_max_rad_s=arguments.speed("turn", "w_rad_s", w_rad_s, limits.w_max_rad_s))
        heading_rad = self._reference().theta_rad
        motion = motions.spin(angle_rad, limits, heading_rad)
        result = self._move(motion, unseen=unseen, cure="call forward(0.4) first")
        # The place of the pose: with the bearing of a wall, the error of its range changes, and with it where
        # the map sees a robot that has only turned (URG-04LX: up to 5 cm). The heading hardly changes so.
        place = self.pose
        target = Pose2(x_m=place.x_m, y_m=place.y_m, theta_rad=wrap_angle(heading_rad + angle_rad))
        self._target = target if result.reached else None
        return result

    def drive(self, *, v_m_s: float = 0.0, w_rad_s: float = 0.0, duration_s: float) -> None:
        """Drive at this speed (forward, counter-clockwise) for `duration_s`, then stop. Ignores obstacles.

        Raises
        ------
        ThumperError
            An invalid number, or the board has stopped the motors; the message says why.
        """
        v_max_m_s, w_max_rad_s = (
            self._config.service.manual_v_max_m_s,
            self._config.service.manual_w_max_rad_s,
        )
        where = "([service] in the configuration)"
        v_m_s = arguments.between("drive", "v_m_s", v_m_s, -v_max_m_s, v_max_m_s, f"m/s {where}")
        w_rad_s = arguments.between("drive", "w_rad_s", w_rad_s, -w_max_rad_s, w_max_rad_s, f"rad/s {where}")
        duration_s = arguments.duration_s("drive", duration_s)
        result = self._carry_out(tasks.cruise(Twist2(v_m_s=v_m_s, w_rad_s=w_rad_s), duration_s))
        if not result.reached:
            raise ThumperError(f"the drive ended early: {result.reason}")

    def goto(
        self,
        x_m: float | arguments.Place,
        y_m: float | None = None,
        *without_unit: Never,
        heading_rad: float | None = None,
        heading_deg: float | None = None,
        tolerance_m: float = 0.1,
    ) -> DriveResult:
        """Plan a path to a place in the map, drive there around obstacles and return the result.

        `goto(0.5, -0.5)` takes metres, `goto("kitchen")` a place that was saved with the map. A tuple or
        mapping is a place as in `patrol`. Without a heading, any will do. The robot stops within
        `tolerance_m` of the place, 0.02...1. Time and path length are those of this drive.

        Raises
        ------
        ThumperError
            Before anything moves: an unknown place; a goal that the map already shows in or too near a wall,
            in a keep-out zone, or more than 50 m away; a latched fault; an invalid number. If the robot sees
            the wall only later, or the wall shuts the goal off, the result is not `reached`.
        """
        given_rad = arguments.heading_rad("goto", without_unit, heading_rad, heading_deg)
        if y_m is None and isinstance(x_m, int | float):
            raise arguments.wrong("goto", "y_m", "is missing; pass x_m and y_m, or the name of a place")
        named = x_m if y_m is None else (x_m, y_m)
        place = arguments.place("goto", "the goal", named, self._loop.annotations)
        goal = Goal(
            x_m=place.x_m,
            y_m=place.y_m,
            theta_rad=place.heading_rad if given_rad is None else given_rad,
            tolerance_m=arguments.between("goto", "tolerance_m", tolerance_m, *GOAL_TOLERANCE_M, "m"),
        )
        return self._carry_out(tasks.drive_to_goal(goal))

    def patrol(
        self,
        places: Iterable[arguments.Place],
        *,
        rounds: int = 1,
        tolerance_m: float = 0.1,
        wait_s: float = 0.0,
    ) -> DriveResult:
        """Drive to all places in turn, `rounds` times; end at the first that is not reached.

        A place is the name of a saved one, (x_m, y_m), (x_m, y_m, heading_rad), or dict(x_m=1.0, y_m=0.0,
        heading_deg=90). At each, wait for `wait_s`, motors off. To do something else there, call `goto` in a
        loop.

        Raises
        ------
        ThumperError
            As `goto`, for the first place.
        """
        if not isinstance(rounds, int) or rounds < 1:
            raise arguments.wrong("patrol", "rounds", "choose 1 or more")
        tolerance_m = arguments.between("patrol", "tolerance_m", tolerance_m, *GOAL_TOLERANCE_M, "m")
        goals = [
            Goal(x_m=place.x_m, y_m=place.y_m, theta_rad=place.heading_rad, tolerance_m=tolerance_m)
            for place in arguments.places("patrol", places, self._loop.annotations)
        ]
        wait_s = arguments.between("patrol", "wait_s", wait_s, 0.0, MAX_WAIT_S, "s")
        waypoints = Waypoints.at(*goals, rounds=rounds, wait_s=wait_s)
        return self._carry_out(tasks.follow_waypoints(waypoints))

    def explore(self, *, minutes: float = 15.0) -> DriveResult:
        """Drive from frontier to frontier until the place is mapped, or for `minutes`, then come back.

        The result's `reason` says how many frontiers it reached.

        Raises
        ------
        ThumperError
            An invalid number, or the board has latched a fault.
        """
        from thumper.navigation.planners.frontier_exploration import ExplorationOptions, Explorer
        from thumper.runtime.drive.exploration import explore, home_at

        limit_s = 60.0 * arguments.above_zero("explore", "minutes", minutes, MAX_EXPLORE_MINUTES, "minutes")
        home = home_at(self.pose)
        explorer = Explorer(ExplorationOptions(), self._config.footprint)
        task = explore(explorer, self._loop.map_and_pose, home, limit_s=limit_s)
        return self._carry_out(task)

    def dock(self) -> DriveResult:
        """Dock at the charger by the tag on it; `[dock]` of the configuration describes it.

        Raises
        ------
        ThumperError
            The robot has no camera, or the board has latched a fault.
        """
        return self._carry_out(self._docking().dock())

    def undock(self) -> DriveResult:
        """Drive back from the dock.

        Raises
        ------
        ThumperError
            As `dock`.
        """
        return self._carry_out(self._docking().undock())

    def _docking(self) -> "Docking":
        docking = self._loop.request_handler.docking
        if not docking.is_possible:
            raise ThumperError("dock: there is no camera; set [camera] enabled = true", exit_code=EXIT_USAGE)
        return docking

    def stop(self) -> None:
        """Stop and switch the motors off; from another thread, end the call that drives.

        That call then returns a result that is not `reached`. No call leaves the motors on, so between calls
        there is nothing to stop.

        Raises
        ------
        ThumperError
            The robot is not open, or its board did not confirm the stop.
        """
        self._is_stopped = True
        if self._is_busy:
            self._loop.request_queue.put(RobotCommand(name="cancel"))
        elif not self._loop.stop():
            raise ThumperError(UNCONFIRMED, exit_code=EXIT_NOT_THERE)

    def wait(self, duration_s: float = 1.0) -> None:
        """Stay stationary and continue mapping for a while.

        Raises
        ------
        ThumperError
            An invalid duration, or the board is silent.
        """
        duration_s = arguments.duration_s("wait", duration_s)
        result = self._run(tasks.wait(duration_s))
        if not result.reached:
            raise ThumperError(result.reason, exit_code=EXIT_NOT_THERE)

    @property
    def pose(self) -> Pose2:
        """The robot's pose in the map [m, m, rad]."""
        self._catch_up()
        return self._state.map_from_base

    @property
    def map(self) -> OccupancyGrid:
        """The map so far: `cells` of shape (rows, columns), its resolution [m] and its origin [m]."""
        return self._catch_up().mapper.grid()

    @property
    def scan(self) -> Scan:
        """The newest scan: `ranges_m` of shape (n,); `angles_rad()` gives each beam in the laser frame."""
        scan = self._catch_up().inputs.newest_scan
        assert scan is not None  # the first scans came with `open`
        return scan

    @property
    def telemetry(self) -> Telemetry:
        """The newest telemetry of the board, in its own units: mrad/s, mV, mA, counts."""
        telemetry = self._catch_up().inputs.telemetry
        assert telemetry is not None
        return telemetry

    @property
    def wheel_speeds(self) -> WheelSpeeds:
        """The measured speeds of the left and the right wheels [rad/s]."""
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
        """All since the start: `speeds`, shape (n, 8), `poses`, shape (n, 4), and `plans`, each (n, 2)."""
        return self._opened.log

    def plot(self) -> "RobotFigure":
        """Return a matplotlib figure: map, plans, driven path, newest scan and robot. A notebook shows it."""
        self._catch_up()
        return self._snapshot()()

    def show(self) -> None:
        """Show `plot()` in a notebook, and redraw it each second while the robot drives.

        Raises
        ------
        ThumperError
            IPython is missing; the message names the package. Or this is not a notebook.
        """
        require_extra("notebooks")
        from thumper.robot.live_figure import LiveFigure, in_notebook

        if not in_notebook():
            raise ThumperError(
                'show: this is not a notebook; save the picture with robot.plot().savefig("map.png")',
                exit_code=EXIT_USAGE,
            )
        self._catch_up()
        self._live_figure = live = LiveFigure(self._snapshot)
        self._loop.after_cycle[:] = [live.refresh]

    def save_map(self, path: str | Path) -> Path:
        """Write PATH.yaml and PATH.pgm in map_server's format and PATH.session; return the first.

        `path` may end in .yaml; any other suffix becomes part of the name.

        Raises
        ------
        ThumperError
            It is not a path, or cannot be written.
        """
        yaml_path = map_yaml_path(arguments.file_path("save_map", "path", path))
        save_map(self.map, yaml_path)
        state = SavedSlamState.from_mapper(self._opened.mapper, self.pose)
        save_session(state, yaml_path.with_suffix(".session"))
        save_annotations(self._opened.annotations, annotations_path(yaml_path))
        return yaml_path

    @property
    def _opened(self) -> RobotLoop:
        """The loop, to read from it; the robot is open or was."""
        if self._robot_loop is None:
            raise ThumperError(NOT_OPEN, exit_code=EXIT_USAGE)
        return self._robot_loop

    @property
    def _loop(self) -> RobotLoop:
        """The loop, to drive with it."""
        if not self._is_open:
            raise ThumperError(NOT_OPEN, exit_code=EXIT_USAGE)
        return self._opened

    @property
    def _state(self) -> RobotState:
        state = self._opened.inputs.estimator.state()
        assert state is not None
        return state

    def _catch_up(self) -> RobotLoop:
        """Return the loop to read from, up to date if the robot is open."""
        if self._is_open:
            self._loop.wait_for_map()
        return self._opened

    def _reference(self) -> Pose2:
        """Return where the last `forward` or `turn` should have ended, if the robot is near it, or its pose.

        So the errors of a sequence do not add up.
        """
        pose, target = self.pose, self._target
        if target is None or pose.distance_m(target) > NEAR_M:
            return pose
        return target if abs(wrap_angle(pose.theta_rad - target.theta_rad)) < NEAR_RAD else pose

    def _snapshot(self) -> "Callable[[], RobotFigure]":
        """Take what there is now, and return what draws it."""
        from thumper.robot.figure import robot_figure

        state = self._state
        return partial(
            robot_figure,
            self._opened.mapper.grid(),
            self.log,
            state.map_from_base,
            self._config.footprint,
            state.hits_in_map_m,
        )

    def _move(self, motion: Motion, *, unseen: bool, cure: str) -> DriveResult:
        navigator = self._loop.drive_manager.navigator

        def obstacles(_state: RobotState) -> ObstaclePoints:
            near = navigator.obstacles
            return near.without_unseen() if unseen else near

        cure = f"{cure}, or pass unseen=True"
        monitor = collision_monitor(self._config)
        motion = motions.before_obstacles(motion, monitor, obstacles, cure=cure)
        return self._carry_out(tasks.move(motion))

    def _carry_out(self, task: Task) -> DriveResult:
        """Run a task that drives; return when the motors are off."""
        result = self._run(task)
        self._await_motors_off()
        if self._live_figure is not None:
            self._live_figure.finish()
        return result

    def _run(self, task: Task) -> DriveResult:
        """Carry out a task; raise KeyboardInterrupt, as any Python code would, if Ctrl-C ended it."""
        forget_interrupts()  # those that the script has caught
        loop = self._loop
        loop.request_queue.take_all()  # a `stop` that came after the last call had ended
        self._is_busy, self._is_stopped = True, False
        try:
            result = loop.run(task, LegLog())
        finally:
            self._is_busy = False
        if result.interrupted and not self._is_stopped:
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
