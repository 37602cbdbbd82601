"""Find out from a drive how the lidar is mounted and whether the odometry is mirrored or in degrees.

The motion between scans, matched without odometry, is compared with the motion of the wheels. Only pieces of
the drive that turn or advance clearly count, and slip never inverts all of them.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from enum import StrEnum

from thumper.common.geometry import Pose2, Twist2, wrap_angle
from thumper.lidar.scan import Scan
from thumper.odometry.constant_velocity import ConstantVelocityOdometry
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.grid.options import GridMapperOptions
from thumper.slam.scan_matching.gauss_newton import MatchOptions

# Uncertainty of a motion that is predicted from the scans before: a robot may start, stop and turn.
PREDICTION_STD_M, PREDICTION_STD_RAD = 0.1, 0.1
USABLE_RANGE_M = 20.0  # farther beams only enlarge the map of a piece
PIECE_M, PIECE_RAD, PIECE_SCANS = 0.5, 0.5, 40  # a piece of the drive ends after this motion, or is dropped
STILL_M, STILL_RAD = 1e-3, 1e-3  # wheels that move less between two scans say nothing
GOOD_SCORE = 0.6  # worst match of a piece that counts
CLEAR_M, CLEAR_RAD = 0.15, 0.2  # motion by the scans that counts
TOLERATED_M, TOLERATED_RAD, TOLERATED_SHARE = 0.05, 0.1, 0.5  # difference between scans and wheels
VOTES = 6  # pieces that turn, and pieces that advance, before a verdict
RIGHT, WRONG = 0.7, 0.3  # share of the pieces that agree with a reading that is right, or wrong
MANY_PIECES, RIGHT_OF_MANY = 30, 0.5  # in a corridor many pieces advance less by the scans than by the wheels
MAX_PIECES = 100  # without a verdict the check ends


class MountFinding(StrEnum):
    """A reading of the lidar's and the odometry's data."""

    AS_IS = "as-is"
    UPSIDE_DOWN = "upside-down"
    TURNED = "turned"
    UPSIDE_DOWN_TURNED = "upside-down-turned"
    MIRRORED = "mirrored"
    MIRRORED_HEADING = "mirrored-heading"
    DEGREES = "degrees"
    MILLIMETRES = "millimetres"


# MIRRORED moves like UPSIDE_DOWN: a mirror image of a drive is a possible drive. The user decides.
CANDIDATES = (
    MountFinding.AS_IS,
    MountFinding.UPSIDE_DOWN,
    MountFinding.TURNED,
    MountFinding.UPSIDE_DOWN_TURNED,
    MountFinding.MIRRORED_HEADING,
    MountFinding.DEGREES,
    MountFinding.MILLIMETRES,
)


def corrected_odometry(odom_from_base: Pose2, mounting: MountFinding) -> Pose2:
    """Return the pose as this reading understands it."""
    if mounting is MountFinding.DEGREES:
        return replace(odom_from_base, theta_rad=wrap_angle(math.radians(odom_from_base.theta_rad)))
    if mounting is MountFinding.MILLIMETRES:
        return replace(odom_from_base, x_m=1e-3 * odom_from_base.x_m, y_m=1e-3 * odom_from_base.y_m)
    if mounting is MountFinding.MIRRORED_HEADING:
        return replace(odom_from_base, theta_rad=-odom_from_base.theta_rad)
    return _mirrored(odom_from_base) if mounting is MountFinding.MIRRORED else odom_from_base


def corrected_laser(base_from_laser: Pose2, mounting: MountFinding) -> Pose2:
    """Return the pose of the laser as this reading understands it."""
    if mounting in (MountFinding.TURNED, MountFinding.UPSIDE_DOWN_TURNED):
        return replace(base_from_laser, theta_rad=wrap_angle(base_from_laser.theta_rad + math.pi))
    return base_from_laser


def corrected_scan(scan: Scan, mounting: MountFinding) -> Scan:
    """Return the scan as this reading understands it."""
    return (
        scan.upside_down()
        if mounting in (MountFinding.UPSIDE_DOWN, MountFinding.UPSIDE_DOWN_TURNED)
        else scan
    )


def describe(mounting: MountFinding, base_from_laser: Pose2) -> str:
    """Return what is wrong, with the lines for the robot's TOML."""
    turned_deg = math.degrees(corrected_laser(base_from_laser, MountFinding.TURNED).theta_rad)
    flip = "lidar.upside_down = true (false if it is true)"
    turn = f"lidar.yaw_deg = {turned_deg:.0f}"
    return {
        MountFinding.AS_IS: "scans and wheels agree",
        MountFinding.UPSIDE_DOWN: "the scans turn against the wheels: the lidar is upside down; set "
        f"{flip}. If it is not, left and right encoder are swapped and the odometry is mirrored",
        MountFinding.TURNED: "the scans advance against the wheels: the lidar is turned by 180 degrees; set "
        f"{turn}",
        MountFinding.UPSIDE_DOWN_TURNED: "the scans turn and advance against the wheels: the lidar is upside "
        f"down and turned by 180 degrees; set {flip} and {turn}. If it is not, both encoders count backwards",
        MountFinding.MIRRORED: "the odometry is mirrored: left and right encoder are swapped",
        MountFinding.MIRRORED_HEADING: "the odometry's heading is mirrored: it must grow counter-clockwise",
        MountFinding.DEGREES: "the odometry's heading is in degrees: it must be in radians",
        MountFinding.MILLIMETRES: "the odometry is in millimetres: it must be in metres",
    }[mounting]


@dataclass(slots=True)
class _Votes:
    """Pieces that agree with a reading."""

    turns: int = 0
    advances: int = 0
    misfit_m: float = 0.0  # between the motions of scans and wheels, over all pieces


@dataclass(slots=True)
class MountCheck:
    """Compares scans with odometry until it is sure. Then `done` is true, and `update` costs nothing."""

    base_from_laser: Pose2
    options: GridMapperOptions = field(default_factory=GridMapperOptions)
    finding: MountFinding | None = None  # None: nothing found to be wrong
    done: bool = False
    _turns: int = 0  # pieces that turn, and pieces that advance
    _advances: int = 0
    _pieces: int = 0
    _votes: dict[MountFinding, _Votes] = field(
        default_factory=lambda: {each: _Votes() for each in CANDIDATES}
    )
    _mapper: GridMapper | None = None
    _prediction: ConstantVelocityOdometry = field(default_factory=ConstantVelocityOdometry)
    _start: Pose2 = field(default_factory=Pose2)  # odometry at the start of the piece
    _last: Pose2 | None = None  # odometry at the last scan
    _scans: int = 0

    def run(self, drive: Iterable[tuple[Pose2, Scan]]) -> MountFinding | None:
        """Return the finding after as much of a recorded drive, odometry and scan, as it takes."""
        for odom_from_base, scan in drive:
            if self.done:
                break
            self.update(odom_from_base, scan)
        return self.finding

    def warm_up(self) -> None:
        """Compile the kernels, or load them from the cache."""
        self._new_mapper().warm_up()

    def update(self, odom_from_base: Pose2, scan: Scan) -> None:
        """Add a scan with its odometry."""
        if self.done:
            return
        last, self._last = self._last, odom_from_base
        if last is not None and _is_still(last.inverse() @ odom_from_base):
            return
        if self._mapper is None:
            self._mapper, self._prediction = self._new_mapper(), ConstantVelocityOdometry()
            self._start, self._scans = odom_from_base, 0
        self._scans += 1
        update = self._mapper.update(self._prediction.predict(), scan, Twist2())
        self._prediction.correct(update.map_from_base)
        moved = update.map_from_base
        if self._scans > 1 and not update.match_score >= GOOD_SCORE:
            self._mapper = None
        elif math.hypot(moved.x_m, moved.y_m) >= PIECE_M or abs(moved.theta_rad) >= PIECE_RAD:
            self._vote(odom_from_base, moved)
            self._mapper = None
        elif self._scans >= PIECE_SCANS:
            self._mapper = None

    def _vote(self, odom_from_base: Pose2, moved: Pose2) -> None:
        """Compare the motion of the scans, as the base moved with the present mounting, with the wheels'."""
        self._pieces += 1
        turns, advances = abs(moved.theta_rad) >= CLEAR_RAD, abs(moved.x_m) >= CLEAR_M
        self._turns += turns
        self._advances += advances
        laser_moved = self.base_from_laser.inverse() @ moved @ self.base_from_laser
        for reading, votes in self._votes.items():
            start, end = (corrected_odometry(pose, reading) for pose in (self._start, odom_from_base))
            wheels = start.inverse() @ end
            base_from_laser = corrected_laser(self.base_from_laser, reading)
            is_flipped = reading in (MountFinding.UPSIDE_DOWN, MountFinding.UPSIDE_DOWN_TURNED)
            laser = _mirrored(laser_moved) if is_flipped else laser_moved
            scans = base_from_laser @ laser @ base_from_laser.inverse()
            turn_rad = abs(wrap_angle(scans.theta_rad - wheels.theta_rad))
            limit_rad = TOLERATED_SHARE * max(abs(scans.theta_rad), abs(wheels.theta_rad))
            limit_m = TOLERATED_SHARE * max(abs(scans.x_m), abs(wheels.x_m))
            votes.turns += turns and turn_rad <= max(TOLERATED_RAD, limit_rad)
            votes.advances += advances and abs(scans.x_m - wheels.x_m) <= max(TOLERATED_M, limit_m)
            votes.misfit_m += scans.distance_m(wheels)
        self._decide()

    def _decide(self) -> None:
        if min(self._turns, self._advances) < VOTES and self._pieces < MAX_PIECES:
            return
        if min(self._turns, self._advances) >= VOTES:
            share = {
                reading: (votes.turns / self._turns, votes.advances / self._advances)
                for reading, votes in self._votes.items()
            }
            right = RIGHT if self._pieces < MANY_PIECES else RIGHT_OF_MANY
            if min(share[MountFinding.AS_IS]) >= right:
                self.done = True
                return
            best = max(CANDIDATES, key=lambda each: (min(share[each]), -self._votes[each].misfit_m))
            if min(share[MountFinding.AS_IS]) <= WRONG and min(share[best]) >= right:
                self.finding, self.done = best, True
        self.done |= self._pieces >= MAX_PIECES

    def _new_mapper(self) -> GridMapper:
        matching = MatchOptions(odometry_std_m=PREDICTION_STD_M, odometry_std_rad=PREDICTION_STD_RAD)
        usable_range_m = min(USABLE_RANGE_M, self.options.usable_range_m)
        options = replace(self.options, matching=matching, usable_range_m=usable_range_m)
        return GridMapper(options, base_from_laser=self.base_from_laser)


def _is_still(step: Pose2) -> bool:
    return math.hypot(step.x_m, step.y_m) < STILL_M and abs(step.theta_rad) < STILL_RAD


def _mirrored(pose: Pose2) -> Pose2:
    return Pose2(x_m=pose.x_m, y_m=-pose.y_m, theta_rad=-pose.theta_rad)
