"""Open the ports that a configuration names and wire the robot's parts to them."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from thumper.board.board import Board
from thumper.board.messages import Identity
from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2
from thumper.common.kinematics import DriveGeometry
from thumper.common.signals import record_interrupts
from thumper.common.stamps import epoch_ns_at
from thumper.config.robot import RobotConfig
from thumper.lidar.open_lidar import open_lidar
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.warm_up import warm_up as warm_up_navigation
from thumper.ros.to_ros import Messages
from thumper.runtime.loop import RobotLoop
from thumper.runtime.publisher import Publisher
from thumper.runtime.state_estimator import StateEstimator
from thumper.slam.factory import make_mapper
from thumper.slam.mode_switch import SlamModeSwitch
from thumper.slam.saved_state import SavedSlamState


@contextmanager
def open_robot(
    config: RobotConfig, map_from_base: Pose2 | None, known: OccupancyGrid | SavedSlamState | None = None
) -> Iterator[RobotLoop]:
    """Give a robot that answers, standing at `map_from_base`; on the way out stop it and close the ports.

    In a `known` map it localises and does not map, in a session it goes on mapping once it knows where it is;
    None for the pose then means anywhere in it.

    Raises
    ------
    ThumperError
        A port, the board or the lidar does not answer; the message names it and the cure.
    """
    warm_up(config)  # compiling takes seconds, and must not happen while wheels turn
    with _motors_off_told(), ExitStack() as stack:
        stack.enter_context(record_interrupts())
        board = Board.open(config.board.port, baud=config.board.baud)
        stack.callback(board.close)
        _check_geometry(config.drive, board.identity)
        lidar = open_lidar(config.lidar)
        stack.callback(lidar.close)
        base_from_laser = config.lidar.base_from_laser
        mapper = robot_mapper(config, map_from_base or Pose2())
        if isinstance(known, SavedSlamState):
            mapper.resume_from(known.counts, map_from_base)
        elif known is not None:
            mapper.localize_in(known, map_from_base)
        robot = RobotLoop(
            board=board,
            lidar=lidar,
            publisher=_publisher(config, board),
            service=config.service,
            open_board=lambda: Board.open(config.board.port, baud=config.board.baud),
            open_lidar=lambda: open_lidar(config.lidar),
            simulator=getattr(board.port.raw, "simulator", None),
            estimator=StateEstimator(
                drive=config.drive, base_from_laser=base_from_laser, mapper=mapper, imu=config.imu
            ),
            navigation=config.navigation,
            footprint=config.footprint,
            view=config.lidar.view,
            drive=config.drive,
            max_wheel_rad_s=config.drive.max_wheel_rad_s,
        )
        try:
            yield robot
        finally:
            robot.inputs.board.close()  # those at the end, should the first have been lost
            robot.inputs.lidar.close()


@contextmanager
def _motors_off_told() -> Iterator[None]:
    """Let a Ctrl-C that ends the robot say what it has left."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt("the motors are off") from None


def robot_mapper(config: RobotConfig, map_from_base: Pose2) -> SlamModeSwitch:
    """The mapper that the configuration names, which can be told to localise instead."""
    base_from_laser = config.lidar.base_from_laser
    mapper = make_mapper(config.mapping, base_from_laser=base_from_laser, map_from_base=map_from_base)
    return SlamModeSwitch(mapper, config.mapping, config.localization, base_from_laser=base_from_laser)


def _publisher(config: RobotConfig, board: Board) -> Publisher:
    simulated = board.port.is_simulated
    # A simulation begins at zero; a real robot's stamps are the date.
    epoch_ns = 0 if board.port.has_simulated_clock else epoch_ns_at(board.now_s())
    return Publisher(
        robot=config.name,
        base_from_laser=config.lidar.base_from_laser,
        messages=Messages(epoch_ns=epoch_ns),
        simulated=simulated,
    )


def _check_geometry(drive: DriveGeometry, identity: Identity) -> None:
    """The board turns counts into speeds by its own geometry: with another one here speeds would be wrong."""
    wheel_radius_mm = round(1000.0 * drive.wheel_radius_m)
    if (identity.counts_per_rev, identity.wheel_radius_mm) != (drive.counts_per_rev, wheel_radius_mm):
        raise ThumperError(
            f"the firmware was built for {identity.counts_per_rev} counts a turn and wheels of "
            f"{identity.wheel_radius_mm} mm, the configuration says {drive.counts_per_rev} and "
            f"{wheel_radius_mm} mm: correct [drive], or build and flash the firmware for this robot",
            exit_code=EXIT_USAGE,
        )


def warm_up(config: RobotConfig) -> None:
    """Compile the kernels, or load them from the cache."""
    robot_mapper(config, Pose2()).warm_up()
    warm_up_navigation(config.navigation, config.footprint)
