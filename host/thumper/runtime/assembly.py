"""Opens the ports that a configuration names and wires the robot's parts to them."""

import gc
import math
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path

from thumper.board.board import Board
from thumper.board.gyroscope import check_gyroscope
from thumper.board.messages import GyroscopeState, Identity
from thumper.board.parameters import parameter_named
from thumper.camera.detector_thread import FindObjects, detector_thread
from thumper.camera.frame import CameraFrame
from thumper.camera.tag_tracker import TagTracker
from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2
from thumper.common.sensor import ReopenedSensor
from thumper.common.serial_port import check_port
from thumper.common.signals import raise_lost_interrupt, record_interrupts
from thumper.common.stamps import epoch_ns_at
from thumper.config.robot import DriveOptions, RobotConfig, shared_port
from thumper.gps.earth_reference import EarthReference, MapDatum
from thumper.gps.fix import FixStatus
from thumper.lidar.driver import LidarDriver
from thumper.lidar.open_lidar import open_lidar
from thumper.lidar.self_returns import SelfReturnFilter
from thumper.maps.annotations import Annotations
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.footprint import Footprint
from thumper.navigation.navigator import Navigator
from thumper.navigation.options import NavigationOptions
from thumper.navigation.safety.collision_monitor import CollisionMonitor
from thumper.navigation.speed_limits import SpeedLimits, WheelRamp
from thumper.navigation.warm_up import warm_up as warm_up_navigation
from thumper.odometry.drive_train_monitor import DriveTrainMonitor
from thumper.ros.to_ros import Messages
from thumper.runtime.drive.assisted_teleop import AssistedTeleop
from thumper.runtime.drive.docking import Docking
from thumper.runtime.drive.drive_manager import DriveManager
from thumper.runtime.drive.goal_limits import GoalLimits
from thumper.runtime.drive.task_driver import TaskDriver
from thumper.runtime.loop import UNCONFIRMED, RobotLoop, RobotParts
from thumper.runtime.object_finder import ObjectFinder
from thumper.runtime.object_map import ObjectMap
from thumper.runtime.publisher import Publisher
from thumper.runtime.reconnection import Connecting, Reconnection
from thumper.runtime.requests import LogMessage
from thumper.runtime.sensor_inputs import TELEMETRY_TIMEOUT_S, SensorInputs
from thumper.runtime.sensor_table import CAMERA, KINDS, SensorFeed, open_feed
from thumper.runtime.service.library import MapStorage
from thumper.runtime.service.low_battery import check_low_battery
from thumper.runtime.service.map_annotations import MapAnnotations
from thumper.runtime.service.map_saver import MapSaver
from thumper.runtime.service.request_handler import RequestHandler
from thumper.runtime.service.request_queue import RequestQueue
from thumper.runtime.service.simulator_control import HasSimulator
from thumper.runtime.service.wheels import read_feed_forward
from thumper.runtime.state_estimator import StateEstimator
from thumper.runtime.tag_anchors import TagAnchors
from thumper.slam.factory import MappingOptions, make_mapper
from thumper.slam.localization.options import AmclOptions
from thumper.slam.mode_switch import SlamModeSwitch
from thumper.slam.mounting import MountCheck
from thumper.slam.saved_state import SavedSlamState

FIX_TIMEOUT_S = 60.0
CALIBRATION_TIMEOUT_S = 4.0  # of the gyroscope's bias, for which the robot must be stationary for a second
GYROSCOPE_TIMEOUT_S = 1.5  # opening the port resets the board, which starts its gyroscope within 0.6 s


@contextmanager
def open_robot(
    config: RobotConfig,
    map_from_base: Pose2 | None,
    known: OccupancyGrid | SavedSlamState | None = None,
    *,
    map_path: Path | None = None,
    annotations: Annotations | None = None,
    datum: MapDatum | None = None,
    opened: Path | None = None,
    before_save: Callable[[], None] = lambda: None,
) -> Iterator[RobotLoop]:
    """Open a robot that starts at `map_from_base`; on exit stop it and close the ports.

    In a `known` map it localizes and does not map; in a saved session it resumes mapping once it has
    localized. None for the pose then means anywhere in it; with its `datum`, a GPS says about where.
    `annotations` are those of that map, and `opened` is its file, which the library then protects. With
    `map_path`, a .yaml, the command `save_map` writes the map there. `before_save` runs before the map is
    written to the run's folder, by this command or at the end.

    Raises
    ------
    ThumperError
        A port, the board or the lidar does not answer; the message names it and the fix.
    """
    if shared := shared_port(config):
        raise ThumperError(shared, exit_code=EXIT_USAGE)
    check_ports(config)
    with record_interrupts(), raise_lost_interrupt():
        warm_up(config)  # compiling takes seconds, which must not pass while wheels turn
    with _report_motors_off(), ExitStack() as stack:
        stack.enter_context(record_interrupts())
        find_objects = None
        if config.camera.enabled and config.camera.detector:
            find_objects = stack.enter_context(detector_thread(config.camera))
        board = Board.open(config.board.port, baud=config.board.baud)
        stack.callback(board.close)
        config = replace(config, drive=_checked_geometry(config, board))
        if config.imu.uses_board:
            wait_for_gyroscope(board)
        feeds = []
        for kind in KINDS:
            if kind.is_wanted(config):
                feeds.append(open_feed(kind, config))
                stack.callback(feeds[-1].sensor.close)
        lidar = open_lidar(config.lidar)  # last: scans from before the first telemetry have no odometry
        stack.callback(lidar.close)
        mapper = robot_mapper(config, map_from_base or Pose2())
        if isinstance(known, SavedSlamState):
            mapper.resume_from(known.counts, map_from_base)
        elif known is not None:
            mapper.localize_in(known, map_from_base)
        saving = _Saving(
            path=map_path, annotations=annotations or Annotations(), opened=opened, before_save=before_save
        )
        earth = EarthReference(config.gps, datum)
        robot = _wire(
            config, board, lidar, tuple(feeds), mapper, saving, earth=earth, find_objects=find_objects
        )
        if known is not None and map_from_base is None and datum is not None:
            wait_for_fix(robot)
        gc.collect()  # the robots that were open before in this process
        try:
            yield robot
        except KeyboardInterrupt:
            if not robot.inputs.board.close():
                raise KeyboardInterrupt(UNCONFIRMED) from None
            raise
        finally:
            robot.inputs.board.close()  # the present ones: the first may have been replaced
            for sensor in robot.inputs.sensors:
                sensor.close()


def check_ports(config: RobotConfig) -> None:
    """Refuse a wrong port before the kernels are compiled, which may take minutes."""
    sensors = [kind.name for kind in KINDS if kind.is_wanted(config)]
    for name in ("board", "lidar", *sensors):
        check_port(getattr(config, name).port, name)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Saving:
    """What was saved with the map, and where to save it."""

    path: Path | None
    annotations: Annotations
    opened: Path | None = None
    before_save: Callable[[], None]


def _wire(
    config: RobotConfig,
    board: Board,
    lidar: LidarDriver,
    feeds: tuple[SensorFeed, ...],
    mapper: SlamModeSwitch,
    saving: _Saving,
    *,
    earth: EarthReference,
    find_objects: FindObjects | None,
) -> RobotLoop:
    """Build the parts of the robot and the loop that runs them."""
    estimator = StateEstimator(
        drive=config.drive,
        base_from_laser=config.lidar.base_from_laser,
        mapper=mapper,
        imu=config.imu,
        self_returns=SelfReturnFilter(config.lidar.base_from_laser, config.footprint.polygon_m()),
        drive_train=_drive_train(board),
        earth=earth,
    )
    inputs = SensorInputs(
        board=board,
        lidar=ReopenedSensor("lidar", lidar, lambda: open_lidar(config.lidar)),
        feeds=feeds,
        estimator=estimator,
    )
    navigator = Navigator(
        config.navigation,
        config.footprint,
        config.drive,
        view=config.lidar.view,
        on_transition=inputs.log_transition,
    )
    drive_manager = DriveManager(
        board=board,
        navigator=navigator,
        drive=config.drive,
        max_wheel_rad_s=config.drive.max_wheel_rad_s,
        options=config.service,
        assisted_teleop=(
            AssistedTeleop(collision_monitor(config), config.lidar.view) if config.service.assisted else None
        ),
    )
    task_driver = TaskDriver(inputs, drive_manager, GoalLimits(estimator=estimator, navigator=navigator))
    publisher, queue = _publisher(config, inputs), RequestQueue()
    map_annotations = MapAnnotations(
        saving.annotations,
        navigator=navigator,
        estimator=estimator,
        footprint=config.footprint,
        publisher=publisher,
    )
    if config.camera.enabled:
        estimator.tags = TagAnchors(
            config.camera,
            config.dock.tag_size_m,
            known=lambda: map_annotations.value.tags,
            survey=map_annotations.survey,
            report=publisher.publish_event,
        )
    objects = ObjectMap()
    finder = None
    if find_objects is not None:
        finder = ObjectFinder(
            find_objects,
            config.camera,
            estimator=estimator,
            publisher=publisher,
            objects=objects,
            newest_frames=_newest_frames(inputs) or list,
            is_simulated=board.port.has_simulated_clock,
        )
    saver = _map_saver(estimator, map_annotations, queue, saving) if saving.path else None
    handler = RequestHandler(
        request_queue=queue,
        drive_manager=drive_manager,
        task_driver=task_driver,
        inputs=inputs,
        publisher=publisher,
        simulator=board.port.raw.simulator if isinstance(board.port.raw, HasSimulator) else None,
        storage=MapStorage(
            folder=Path(config.recording.folder),
            annotations=map_annotations,
            saver=saver,
            opened=saving.opened,
            objects=objects,
        ),
        docking=_docking(config, inputs, map_annotations, navigator),
    )
    return RobotLoop(
        RobotParts(
            inputs=inputs,
            drive_manager=drive_manager,
            task_driver=task_driver,
            request_queue=queue,
            request_handler=handler,
            publisher=publisher,
            reconnection=Reconnection(inputs, drive_manager, publisher, lambda: _connect(config)),
            object_finder=finder,
            before_save=saving.before_save,
        )
    )


def _docking(
    config: RobotConfig, inputs: SensorInputs, annotations: MapAnnotations, navigator: Navigator
) -> Docking:
    """Return what docks the robot; it needs a camera."""
    return Docking(
        options=config.dock,
        inputs=inputs,
        tracker=TagTracker(config.dock.tag, config.dock.tag_size_m, config.camera),
        limits=config.navigation.limits,
        monitor=collision_monitor(config),
        obstacles=lambda: navigator.obstacles,
        newest_frames=_newest_frames(inputs),
        annotations=lambda: annotations.value,
    )


def _newest_frames(inputs: SensorInputs) -> Callable[[], list[CameraFrame]] | None:
    """Return what returns the camera's frames of a cycle; None without a camera."""
    feed = next((feed for feed in inputs.feeds if feed.kind is CAMERA), None)
    return None if feed is None else lambda: feed.samples


def wait_for_fix(robot: RobotLoop) -> None:
    """Wait for the first fix, up to a minute: similar places differ only in their position on Earth.

    Meanwhile the other sensors are read, so that nothing old waits in their ports. The scans are dropped: the
    search of the map needs the fix first.
    """
    inputs, estimator = robot.inputs, robot.inputs.estimator
    if not inputs.has_gps:
        return
    until_s, inputs.keep_log = inputs.now_s() + FIX_TIMEOUT_S, False
    print(f"waiting for the first GPS fix, at most {FIX_TIMEOUT_S:g} s", file=sys.stderr, flush=True)
    while inputs.now_s() < until_s and (estimator.fix is None or estimator.fix.status is FixStatus.NONE):
        inputs.add_telemetry(inputs.board.poll(TELEMETRY_TIMEOUT_S))
        inputs.lidar.poll()
    inputs.keep_log = True
    if inputs.now_s() >= until_s:
        print("no GPS fix: searching the whole map for the pose", file=sys.stderr, flush=True)


def wait_for_gyroscope(board: Board) -> None:
    """Wait until the board's gyroscope answers and has its bias; raises ThumperError if it is off or silent.

    A robot that is moved meanwhile starts without the bias: the board measures it at the next stop.
    """
    state, start_s = GyroscopeState.MISSING, board.now_s()
    timeouts_s = {
        GyroscopeState.MISSING: GYROSCOPE_TIMEOUT_S,
        GyroscopeState.CALIBRATING: CALIBRATION_TIMEOUT_S,
    }
    while board.now_s() - start_s < timeouts_s.get(state, 0.0):
        for sample in board.poll(TELEMETRY_TIMEOUT_S):
            state = sample.telemetry.gyroscope
    check_gyroscope(state)


def collision_monitor(config: RobotConfig) -> CollisionMonitor:
    """Return the collision monitor of motion that the navigator does not command."""
    limits = config.navigation.limits
    ramp = WheelRamp.from_drive(limits, config.drive)
    return CollisionMonitor(config.navigation.monitor, limits, config.footprint, ramp)


def _drive_train(board: Board) -> DriveTrainMonitor:
    identity = board.identity
    return DriveTrainMonitor(
        counts_per_rev=identity.counts_per_rev,
        pwm_frequency_Hz=identity.pwm_frequency_Hz,
        feed_forward=read_feed_forward(board),
    )


def _connect(config: RobotConfig) -> Connecting:
    """Reach the configured board again; raises ThumperError if it is another one."""
    board = yield from Board.connect(config.board.port, baud=config.board.baud)
    try:
        _checked_geometry(config, board)
    except ThumperError:
        board.close()
        raise
    return board


def robot_mapper(config: RobotConfig, map_from_base: Pose2) -> SlamModeSwitch:
    """Return the configured mapper, which can also switch to localization."""
    base_from_laser = config.lidar.base_from_laser
    mapper = make_mapper(config.mapping, base_from_laser=base_from_laser, map_from_base=map_from_base)
    return SlamModeSwitch(mapper, config.mapping, config.localization, base_from_laser=base_from_laser)


def _publisher(config: RobotConfig, inputs: SensorInputs) -> Publisher:
    port = inputs.board.port
    # A simulation starts at zero; the stamps of a real robot are dates.
    epoch_ns = 0 if port.has_simulated_clock else epoch_ns_at(inputs.board.now_s())
    return Publisher(
        robot=config.name,
        base_from_laser=config.lidar.base_from_laser,
        base_from_gps=config.gps.base_from_antenna if config.gps.enabled else None,
        camera=config.camera if config.camera.enabled else None,
        messages=Messages(epoch_ns=epoch_ns),
        now_s=inputs.now_s,
        simulated=port.is_simulated,
    )


def _map_saver(
    estimator: StateEstimator, annotations: MapAnnotations, queue: RequestQueue, saving: _Saving
) -> MapSaver:
    assert saving.path is not None

    def session() -> SavedSlamState:
        state = estimator.state()
        return SavedSlamState.from_mapper(estimator.mapper, state.map_from_base if state else None)

    def report(text: str, ok: bool) -> None:
        queue.put(LogMessage(text=text, good=ok))

    def annotated() -> Annotations:
        return annotations.value

    return MapSaver(
        estimator.mapper.grid,
        session,
        annotated,
        saving.path,
        report,
        datum=estimator.map_datum,
        before_save=saving.before_save,
    )


@contextmanager
def _report_motors_off() -> Iterator[None]:
    """Add to a Ctrl-C that ends the robot that its motors are off, unless it says what else is known."""
    try:
        yield
    except KeyboardInterrupt as interrupt:
        raise KeyboardInterrupt(str(interrupt) or "the motors are off") from None


EFFECTIVE_TRACKS = 0.9, 2.5
"""Least and largest effective track, in distances between the wheels: 1.5 here, 1 without slip."""
GEOMETRY = ("track_m", "counts_per_rev", "wheel_radius_m")
"""What the board also knows; settled once it has answered, so a different board later is a contradiction."""


def _checked_geometry(config: RobotConfig, board: Board) -> DriveOptions:
    """Return the geometry; refuse a board whose settings contradict the configuration."""
    drive = geometry_of(config.drive, board.identity)
    check_low_battery(config.dock, board.identity)
    check_braking(
        config.navigation.limits, board.get_parameter("acceleration"), board.get_parameter("deceleration")
    )
    return drive


def geometry_of(drive: DriveOptions, identity: Identity) -> DriveOptions:
    """Return the geometry, the board's where the configuration states nothing.

    Refuses a contradiction: the board converts counts to speeds, which would be wrong. The track of the
    configuration is the effective one, which slip makes up to twice that of the board.
    """
    if not drive.states("track_m") and identity.track_mm != parameter_named("track").default:
        drive = replace(drive, track_m=identity.track_mm / 1000.0)
    least, most = EFFECTIVE_TRACKS
    if not least <= drive.track_m / (identity.track_mm / 1000.0) <= most:
        raise ThumperError(
            f"the board is set to a track of {identity.track_mm} mm, the configuration says "
            f"{1000.0 * drive.track_m:.0f} mm: correct [drive], or set track on the board",
            exit_code=EXIT_USAGE,
        )
    if not drive.states("counts_per_rev"):
        drive = replace(drive, counts_per_rev=identity.counts_per_rev)
    if not drive.states("wheel_radius_m"):
        drive = replace(drive, wheel_radius_m=identity.wheel_radius_mm / 1000.0)
    wheel_radius_mm = round(1000.0 * drive.wheel_radius_m)
    if (identity.counts_per_rev, identity.wheel_radius_mm) != (drive.counts_per_rev, wheel_radius_mm):
        raise ThumperError(
            f"the board is set to {identity.counts_per_rev} counts per revolution and wheels of "
            f"{identity.wheel_radius_mm} mm, the configuration says {drive.counts_per_rev} and "
            f"{wheel_radius_mm} mm: correct [drive], or set counts_per_rev and wheel_radius on the board",
            exit_code=EXIT_USAGE,
        )
    return replace(drive, stated=GEOMETRY)


def check_braking(limits: SpeedLimits, acceleration: float, deceleration: float) -> None:
    """Refuse a board whose wheels brake more slowly than the collision monitor assumes [rad/s^2].

    On the board, deceleration 0 means as acceleration, and acceleration 0 means no ramp.
    """
    board_rad_s2 = deceleration or acceleration or math.inf
    if acceleration and board_rad_s2 < limits.wheel_decel_rad_s2:
        raise ThumperError(
            f"the board brakes its wheels with {board_rad_s2:g} rad/s^2, the collision monitor expects "
            f"{limits.wheel_decel_rad_s2:g}: set [navigation.limits] wheel_decel_rad_s2, or deceleration on "
            "the board (`thumper parameters`)",
            exit_code=EXIT_USAGE,
        )


def warm_up(config: RobotConfig) -> None:
    """Compile the kernels, or load them from the cache: once, though a campaign opens hundreds of robots."""
    _freeze("modules")
    _warm_up(config.mapping, config.localization, config.navigation, config.footprint)
    _freeze("kernels")


@lru_cache
def _warm_up(
    mapping: MappingOptions, localization: AmclOptions, navigation: NavigationOptions, footprint: Footprint
) -> None:
    """Take only what decides which kernels are compiled: the ports differ from robot to robot."""
    robot_mapper(RobotConfig(mapping=mapping, localization=localization), Pose2()).warm_up()
    MountCheck(Pose2()).warm_up()
    warm_up_navigation(navigation, footprint)


@cache
def _freeze(loaded: str) -> None:
    """Let no garbage collection visit what is loaded now; once, since later there are robots to be freed.

    Modules and kernels are 0.1 s on a desktop and 0.4 s on a Raspberry Pi, and the board stops the motors
    after 0.3 s.
    """
    del loaded
    gc.freeze()
