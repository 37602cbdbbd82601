"""Build a map from a recorded log, as `thumper map-log` does."""

import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.files import write_csv
from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.scan_checks import ScanChecker
from thumper.maps.hit_counts import HitCounts
from thumper.maps.map_server_io import save_map
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.odometry.constant_velocity import ConstantVelocityOdometry
from thumper.odometry.jump_filter import JumpFilter
from thumper.odometry.slip_detector import GOOD_MATCH, SlipDetector
from thumper.offline.open_log import open_log
from thumper.offline.robot_log import RobotLog, corrected
from thumper.offline.subprocesses import compile_in_subprocess, plot_in_subprocess
from thumper.slam.factory import MappingOptions, PathMapper, make_mapper
from thumper.slam.mapper import ChecksMap, MapperUpdate
from thumper.slam.mode_switch import SlamModeSwitch
from thumper.slam.mounting import PREDICTION_STD_M, PREDICTION_STD_RAD, MountCheck, MountFinding, describe
from thumper.slam.saved_state import SavedSlamState, save_session
from thumper.slam.scan_matching.pose_trust import MIN_DISTANCE_M

PROGRESS_EVERY = 20  # scans
MAX_LOST_SHARE = 0.5  # of the scans of a log that continues a session


@dataclass(frozen=True, slots=True, kw_only=True)
class MapLogSummary:
    """Result of a mapped log, for a few lines on the screen."""

    format_name: str
    scans: int
    integrated: int  # scans that changed the map
    path_m: float  # length of the corrected path
    mean_score: float  # mean match score, 0...1; NaN when no scan was matched
    cpu_ms: FloatArray  # CPU time of each scan [ms], shape (scans,)
    wall_s: float  # from opening the log to the last file written
    peak_MB: float | None  # peak memory of this process; None if the system does not report it
    files: tuple[Path, ...]
    notes: tuple[str, ...]  # what was dropped or assumed, one line each


@dataclass(frozen=True, slots=True, kw_only=True)
class LogReading:
    """What a log does not say about itself."""

    fov_rad: float | None = None  # field of view of the lidar, for a log without it
    mounting: MountFinding | None = None  # None: as it is, after a check that scans and odometry fit together


@dataclass(frozen=True, slots=True, kw_only=True)
class MappedLog:
    """The mapper's result for one log, before anything is written. Poses are x, y, theta [m, m, rad]."""

    poses: FloatArray  # of the robot at each scan, after the last scan, shape (n, 3)
    online: FloatArray  # the same as reported after each scan, shape (n, 3)
    updates: tuple[MapperUpdate, ...]
    grid: OccupancyGrid
    counts: Callable[[], HitCounts]  # of the map; large, so they are made when they are needed
    cpu_ms: FloatArray  # of each scan, shape (n,); without kernel compilation and file reading
    lost: int = 0  # number of scans with a lost pose
    lost_at_end: bool = False  # whether the pose of the last scan is lost
    lines: tuple[str, ...] = ()  # defects of the log, one line each


def map_records(
    log: RobotLog,
    options: MappingOptions,
    progress: Callable[[int, int], None] | None = None,
    session: SavedSlamState | None = None,
    start: Pose2 | None = None,
) -> MappedLog:
    """Run the mapper over a log; calls `progress(done, total)` now and then.

    With a session it continues that map, from the pose `start` or after a global localization.
    """
    if not log.has_odometry:
        matching = replace(
            options.matching, odometry_std_m=PREDICTION_STD_M, odometry_std_rad=PREDICTION_STD_RAD
        )
        options = replace(options, matching=matching)
    mapper = _mapper(log, options, session, start)
    mapper.warm_up()
    total = len(log.records)
    updates: list[MapperUpdate] = []
    checker, slip, jumps = ScanChecker(), SlipDetector(), JumpFilter()
    lost: list[tuple[int, str]] = []  # number of the scan, and why its pose is lost
    prediction = None if log.has_odometry else ConstantVelocityOdometry()
    cpu_ms = np.empty(total)
    for done, record in enumerate(log.records, start=1):
        start_s = time.process_time()
        checker.check(record.scan)
        odom_from_base = (
            prediction.predict() if prediction else jumps.filter(record.time_s, record.odom_from_base)
        )
        update = mapper.update(odom_from_base, record.scan, record.twist)
        updates.append(update)
        if prediction:
            prediction.correct(update.map_from_base)
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
    poses = mapper.path() if session is None else online  # the mapper of a session corrects no old pose
    return MappedLog(
        poses=poses,
        online=online,
        updates=tuple(updates),
        grid=mapper.grid(),
        counts=mapper.counts,
        cpu_ms=cpu_ms,
        lost=len(lost),
        lost_at_end=bool(lost) and lost[-1][0] == total,
        lines=(
            *checker.summary_lines(),
            *jumps.summary_lines(),
            *slip.summary_lines(),
            *_lost_lines(lost, total),
            *filter(None, [mapper.contradiction() if isinstance(mapper, ChecksMap) else ""]),
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
    """Return one line if the pose was lost, else none."""
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
    session: SavedSlamState | None = None,
    start: Pose2 | None = None,
    reading: LogReading | None = None,
) -> MapLogSummary:
    """Write `map.pgm`, `map.yaml`, `map.session`, `map.png` and `trajectory.csv` of a log into `out_dir`.

    The trajectory is the final path. With `online` it holds the poses as reported after each scan, and the
    final path goes to `trajectory_final.csv`. `session` and `start` are those of `map_records`.

    Raises
    ------
    ThumperError
        The log cannot be read, its scans contradict its odometry, global localization in the session fails,
        or the directory is not writable.
    """
    start_s = time.monotonic()
    reading = reading or LogReading()
    log = open_log(path, reading.fov_rad)
    log = log if reading.mounting is None else corrected(log, reading.mounting)
    try:
        out_dir.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ThumperError(
            f"{out_dir}: cannot create the directory ({error.strerror}); choose another one"
        ) from error
    options = options or MappingOptions()
    compile_in_subprocess(options.method)
    if reading.mounting is None:
        _check_mounting(path, log)
    mapped = map_records(log, options, progress, session, start)
    _check_mapped(path, mapped, in_session=session is not None)
    files = _write_map(path.name, out_dir, log, mapped, online=online)
    scores = [u.match_score for u in mapped.updates if not math.isnan(u.match_score)]
    return MapLogSummary(
        format_name=log.format_name,
        scans=len(log.records),
        integrated=sum(u.integrated for u in mapped.updates),
        path_m=_path_length_m(mapped),
        mean_score=float(np.mean(scores)) if scores else math.nan,
        cpu_ms=mapped.cpu_ms,
        wall_s=time.monotonic() - start_s,
        peak_MB=_peak_MB(),
        files=files,
        notes=(*log.notes, *mapped.lines),
    )


def _check_mounting(path: Path, log: RobotLog) -> None:
    """Raise ThumperError if the lidar or the odometry must be read in another way: the map would be wrong."""
    if not log.has_odometry:
        return
    check = MountCheck(log.base_from_laser)
    found = check.run((record.odom_from_base, record.scan) for record in log.records)
    if found is not None:
        raise ThumperError(
            f"{path}: {describe(found, log.base_from_laser)}. To map this log, pass --mount {found} "
            f"(--mount {MountFinding.AS_IS} maps it unchanged)",
            exit_code=EXIT_USAGE,
        )


def _check_mapped(path: Path, mapped: MappedLog, *, in_session: bool) -> None:
    """Raise ThumperError if nothing was mapped, or if the log does not fit the session's map."""
    if not any(update.integrated for update in mapped.updates):
        if in_session:
            lost = "does the log belong to the session? --start may help"
            still = (
                f"the log is localized, but the robot moves less than {MIN_DISTANCE_M:g} m: no scan is added"
            )
            raise ThumperError(f"{path}: {'; '.join((*mapped.lines, lost if mapped.lost else still))}")
        raise ThumperError(
            f"{path}: no scan has enough usable beams: there is nothing to map", exit_code=EXIT_USAGE
        )
    if in_session and mapped.lost > MAX_LOST_SHARE * len(mapped.poses):
        # A search that runs for long enough finds a pose in any map. Adding such scans would ruin the map.
        raise ThumperError(
            f"{path}: the pose in the session's map was lost at {mapped.lost} of {len(mapped.poses)} scans, "
            "so nothing is written; does the log belong to that map? --start may help"
        )


def _write_map(
    name: str, out_dir: Path, log: RobotLog, mapped: MappedLog, *, online: bool
) -> tuple[Path, ...]:
    """Write all files of a mapped log and return their paths."""
    yaml_path, png_path, csv_path = out_dir / "map.yaml", out_dir / "map.png", out_dir / "trajectory.csv"
    pgm_path = save_map(mapped.grid, yaml_path)
    session_path = out_dir / "map.session"
    x_m, y_m, theta_rad = (float(value) for value in mapped.poses[-1])
    # Whoever resumes from a session starts at its pose: a wrong one would spoil the map.
    end = None if mapped.lost_at_end else Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)
    save_session(SavedSlamState(counts=mapped.counts(), map_from_base=end), session_path)
    _write_path(csv_path, log, mapped.online if online else mapped.poses)
    files = [pgm_path, yaml_path, session_path, png_path, csv_path]
    if online:
        files.append(out_dir / "trajectory_final.csv")
        _write_path(files[-1], log, mapped.poses)
    plot_in_subprocess(yaml_path, files[-1], png_path, name)
    return tuple(files)


def _path_length_m(mapped: MappedLog) -> float:
    """Return the length of the path; online, without the steps of localization and loop closure."""
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
    """Write one line per scan, with the stamps of the log."""
    rows = (
        [f"{value:.6f}" for value in (record.time_s, *pose)]
        for record, pose in zip(log.records, poses, strict=True)
    )
    write_csv(csv_path, ("timestamp_s", "x_m", "y_m", "theta_rad"), rows)
