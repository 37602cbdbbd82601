"""From a recorded log to a map: what `thumper map-log` does."""

import csv
import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.scan_checks import ScanChecker
from thumper.maps.hit_counts import HitCounts
from thumper.maps.map_server_io import save_map
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.odometry.jump_filter import JumpFilter
from thumper.odometry.slip_detector import GOOD_MATCH, SlipDetector
from thumper.offline.open_log import open_log
from thumper.offline.robot_log import RobotLog
from thumper.offline.subprocesses import compile_in_subprocess, plot_in_subprocess
from thumper.slam.factory import MappingOptions, PathMapper, make_mapper
from thumper.slam.localization.pose_trust import MIN_DISTANCE_M
from thumper.slam.mapper import MapperUpdate
from thumper.slam.mode_switch import SlamModeSwitch
from thumper.slam.saved_state import SavedSlamState, save_session

PROGRESS_EVERY = 20  # scans
MAX_LOST_SHARE = 0.5  # share of the scans of a log that goes on in a session
# A guess from the motion before says little: a robot may start, stop and turn between two scans.
COASTING_STD_M, COASTING_STD_RAD = 0.1, 0.1
LEAP_M, LEAP_RAD = 0.25, 0.4


@dataclass(frozen=True, slots=True, kw_only=True)
class MapLogSummary:
    """What came out, for a few lines on the screen."""

    format_name: str
    scans: int
    integrated: int  # scans that changed the map
    path_m: float  # length of the corrected path
    mean_score: float  # mean match score, 0...1; NaN when no scan was matched
    cpu_ms: FloatArray  # CPU time of each scan [ms], shape (scans,)
    wall_s: float  # from opening the log to the last file written
    peak_MB: float | None  # largest memory of this process; None where the system does not tell
    files: tuple[Path, ...]
    notes: tuple[str, ...]  # what was left out or guessed, a line each


@dataclass(frozen=True, slots=True, kw_only=True)
class MappedLog:
    """The mapper's work on one log, before anything is written. Poses are x, y, theta [m, m, rad]."""

    poses: FloatArray  # of the robot at each scan, as known at the end, shape (n, 3)
    online: FloatArray  # as reported at the time, shape (n, 3)
    updates: tuple[MapperUpdate, ...]
    grid: OccupancyGrid
    counts: HitCounts
    cpu_ms: FloatArray  # of each scan, shape (n,); without compiling the kernels and reading the file
    lost: int = 0  # scans at which nobody should trust the pose
    lines: tuple[str, ...] = ()  # what was odd about the scans, a line each


class ConstantVelocityOdometry:
    """In the place of odometry: the robot goes on as it moved between the two scans before."""

    def __init__(self) -> None:
        self._odom_from_base = Pose2()
        self._map_from_base: Pose2 | None = None
        self._step = Pose2()

    def predict(self) -> Pose2:
        """`odom_from_base` of the next scan."""
        self._odom_from_base = self._odom_from_base @ self._step
        return self._odom_from_base

    def moved(self, map_from_base: Pose2) -> None:
        """Where that scan was found to have been taken."""
        if self._map_from_base is not None:
            step = self._map_from_base.inverse() @ map_from_base
            # A closed loop bends the map, and the pose with it: that is no motion.
            if step.distance_m(self._step) < LEAP_M and abs(step.theta_rad - self._step.theta_rad) < LEAP_RAD:
                self._step = step
        self._map_from_base = map_from_base


def default_options(log: RobotLog) -> MappingOptions:
    """Nobody waits for a log, and it may hold a loop of any size: the mapper that closes loops."""
    del log
    return MappingOptions(method="graph")


def map_records(
    log: RobotLog,
    options: MappingOptions,
    progress: Callable[[int, int], None] | None = None,
    session: SavedSlamState | None = None,
    start: Pose2 | None = None,
) -> MappedLog:
    """Run the mapper over a log that was read; `progress(done, total)` is called now and then.

    With a session it goes on in that map, from the pose `start` or from wherever the place is recognised.
    """
    if not log.has_odometry:
        trust = replace(options.matching, odometry_std_m=COASTING_STD_M, odometry_std_rad=COASTING_STD_RAD)
        options = replace(options, matching=trust)
    mapper = _mapper(log, options, session, start)
    mapper.warm_up()
    total = len(log.records)
    updates: list[MapperUpdate] = []
    monitor, slip, bridge = ScanChecker(), SlipDetector(), JumpFilter()
    lost: list[tuple[int, str]] = []  # number of the scan, and why nobody should trust its pose
    coasting = None if log.has_odometry else ConstantVelocityOdometry()
    cpu_ms = np.empty(total)
    for done, record in enumerate(log.records, start=1):
        start_s = time.process_time()
        monitor.check(record.scan)
        odom_from_base = (
            coasting.predict() if coasting else bridge.filter(record.time_s, record.odom_from_base)
        )
        update = mapper.update(odom_from_base, record.scan, record.twist)
        updates.append(update)
        if coasting:
            coasting.moved(update.map_from_base)
        elif update.jumped or update.match_score < GOOD_MATCH:
            slip.reset()
        elif update.match_score >= GOOD_MATCH:
            slip.update(odom_from_base, update.map_from_base)
        cpu_ms[done - 1] = 1e3 * (time.process_time() - start_s)
        if why := mapper.quality().lost:
            lost.append((done, why))
        if progress is not None and (done % PROGRESS_EVERY == 0 or done == total):
            progress(done, total)
    online = np.array(
        [(u.map_from_base.x_m, u.map_from_base.y_m, u.map_from_base.theta_rad) for u in updates]
    )
    poses = mapper.path() if session is None else online  # that mapper revises nothing
    return MappedLog(
        poses=poses,
        online=online,
        updates=tuple(updates),
        grid=mapper.grid(),
        counts=mapper.counts(),
        cpu_ms=cpu_ms,
        lost=len(lost),
        lines=(
            *monitor.summary_lines(),
            *bridge.summary_lines(),
            *slip.summary_lines(),
            *_lost_lines(lost, total),
        ),
    )


def _mapper(
    log: RobotLog, options: MappingOptions, session: SavedSlamState | None, start: Pose2 | None
) -> PathMapper | SlamModeSwitch:
    if session is None:
        return make_mapper(options, base_from_laser=log.base_from_laser)
    first = make_mapper(replace(options, method="scan_match"), base_from_laser=log.base_from_laser)
    mapper = SlamModeSwitch(first, options, base_from_laser=log.base_from_laser)
    mapper.resume_from(session.counts, start)
    return mapper


def _lost_lines(lost: list[tuple[int, str]], total: int) -> list[str]:
    """Nothing, or one line."""
    if not lost:
        return []
    first, why = lost[0]
    return [f"the pose was lost at {len(lost)} of {total} scans, first at scan {first}: {why}"]


def map_log(
    path: Path,
    out_dir: Path,
    progress: Callable[[int, int], None] | None = None,
    options: MappingOptions | None = None,
    *,
    online: bool = False,
    fov_rad: float | None = None,
    session: SavedSlamState | None = None,
    start: Pose2 | None = None,
) -> MapLogSummary:
    """Write `map.pgm`, `map.yaml`, `map.session`, `map.png` and `trajectory.csv` of a log into `out_dir`.

    The trajectory is the final path; with `online` it is the poses reported at the time, and the final path
    goes to `trajectory_final.csv`. `session` and `start` as in `map_records`.

    Raises
    ------
    ThumperError
        The log cannot be read, its place in the session is not recognised, or the folder cannot be written.
    """
    start_s = time.monotonic()
    log = open_log(path, fov_rad)
    try:
        out_dir.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ThumperError(f"{out_dir}: cannot be made ({error.strerror}); give another folder") from error
    options = options or default_options(log)
    compile_in_subprocess(options.method)
    mapped = map_records(log, options, progress, session, start)
    if not any(update.integrated for update in mapped.updates):
        if session is not None:
            doubt = "does it belong to the session? --start may help"
            least = f"{MIN_DISTANCE_M:g} m"
            still = f"the place is recognised, but the robot moves less than {least}: nothing is entered"
            raise ThumperError(f"{path}: {'; '.join((*mapped.lines, doubt if mapped.lost else still))}")
        raise ThumperError(
            f"{path}: no scan has enough usable beams: there is nothing to map", exit_code=EXIT_USAGE
        )
    if session is not None and mapped.lost > MAX_LOST_SHARE * len(log.records):
        # Who searches for long enough finds a place in any map; entering it would spoil the map.
        raise ThumperError(
            f"{path}: its place in the session's map was lost at {mapped.lost} of {len(log.records)} scans, "
            "and nothing is written; does it belong to that map? --start may help"
        )
    yaml_path, png_path, csv_path = out_dir / "map.yaml", out_dir / "map.png", out_dir / "trajectory.csv"
    pgm_path = save_map(mapped.grid, yaml_path)
    session_path = out_dir / "map.session"
    x_m, y_m, theta_rad = (float(value) for value in mapped.poses[-1])
    end = Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)
    save_session(SavedSlamState(counts=mapped.counts, map_from_base=end), session_path)
    _write_path(csv_path, log, mapped.online if online else mapped.poses)
    files = [pgm_path, yaml_path, session_path, png_path, csv_path]
    if online:
        files.append(out_dir / "trajectory_final.csv")
        _write_path(files[-1], log, mapped.poses)
    plot_in_subprocess(yaml_path, files[-1], png_path, path.name)
    scores = [u.match_score for u in mapped.updates if not math.isnan(u.match_score)]
    return MapLogSummary(
        format_name=log.format_name,
        scans=len(log.records),
        integrated=sum(u.integrated for u in mapped.updates),
        path_m=_way_m(mapped),
        mean_score=float(np.mean(scores)) if scores else math.nan,
        cpu_ms=mapped.cpu_ms,
        wall_s=time.monotonic() - start_s,
        peak_MB=_peak_MB(),
        files=tuple(files),
        notes=(*log.notes, *mapped.lines),
    )


def _way_m(mapped: MappedLog) -> float:
    """Length of the path without what a search or a closed loop moved the pose by at the time."""
    steps_m = np.hypot(*np.diff(mapped.poses[:, :2], axis=0).T)
    if mapped.poses is mapped.online:
        steps_m = steps_m[[not update.jumped for update in mapped.updates[1:]]]
    return float(steps_m.sum())


def _peak_MB() -> float | None:
    try:
        import resource
    except ModuleNotFoundError:  # Windows
        return None
    unit = 1024**2 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def _write_path(csv_path: Path, log: RobotLog, poses: FloatArray) -> None:
    """One line a scan, stamps as in the log."""
    try:
        with csv_path.open("w", newline="") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(("timestamp_s", "x_m", "y_m", "theta_rad"))
            for record, (x_m, y_m, theta_rad) in zip(log.records, poses, strict=True):
                writer.writerow((f"{record.time_s:.6f}", f"{x_m:.6f}", f"{y_m:.6f}", f"{theta_rad:.6f}"))
    except OSError as error:
        raise ThumperError(
            f"{csv_path}: cannot be written ({error.strerror}); give another folder", exit_code=EXIT_USAGE
        ) from error
