"""Experiment 8.1 and odometry calibration: drive the course, compare with a reference, print, plot."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from thumper.common.errors import EXIT_CHECK_FAILED, EXIT_USAGE, ThumperError
from thumper.common.files import write_text
from thumper.common.geometry import FloatArray
from thumper.common.kinematics import DriveGeometry
from thumper.common.serial_port import check_port
from thumper.config.robot import RobotConfig
from thumper.lidar.open_lidar import open_lidar
from thumper.lidar.options import LidarModel, LidarOptions
from thumper_tuning.calibration.course import FLOOR, CourseOptions, course
from thumper_tuning.calibration.drive_course import drive_course
from thumper_tuning.calibration.figures import draw_odometry
from thumper_tuning.calibration.odometry_fit import OdometryFit, fit_geometry, odometry_drift
from thumper_tuning.calibration.reference_path import LidarReference, simulated_truth
from thumper_tuning.calibration.wheel_log import (
    COUNT_COLUMNS,
    POSE_COLUMNS,
    WheelLog,
    join_counts_and_poses,
    read_csv,
    write_csv,
)
from thumper_tuning.calibration.wheel_truth import WheelComparison, WheelGeometry, compare_wheel_speeds
from thumper_tuning.drive.console import confirm_room, open_board, progress_bar

THESIS = {"left": (0.796, 0.879), "right": (-0.427, 0.645)}  # mean, std [rad/s], table 8.1
THESIS_TRACK_M = 0.245  # between the contact points of the middle wheels
MAX_HEADING_DRIFT_RAD = 0.35  # slip of free wheels never turns odometry this far in 5 s
SIGNIFICANT_SIGMAS = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveSource:
    """Where a drive and its reference come from: a board (with a lidar), or files."""

    board: str
    lidar: str = ""
    lidar_model: LidarModel = "urg04lx"
    log: Path | None = None
    truth: Path | None = None


def collect_drive(
    source: DriveSource,
    config: RobotConfig,
    options: CourseOptions,
    out: Path,
    *,
    yes: bool,
    console: Console,
) -> WheelLog:
    """Drive the course, or read the files; write wheels.csv and reference.csv to `out`.

    Raises
    ------
    ThumperError
        Not confirmed, no reference, or the board fails.
    """
    if source.log is not None:
        if source.truth is None:
            raise ThumperError(
                f"--log needs --truth: a CSV with the columns {', '.join(POSE_COLUMNS)}", exit_code=EXIT_USAGE
            )
        return join_counts_and_poses(
            read_csv(source.log, COUNT_COLUMNS), read_csv(source.truth, POSE_COLUMNS)
        )
    if source.truth is not None:
        raise ThumperError(
            "--truth belongs to --log: a drive records its own reference", exit_code=EXIT_USAGE
        )
    check_port(source.board, "board")
    confirm_room(f"floor of {FLOOR}", console, yes=yes)
    counts, lidar_reference = _drive(source, config, options, console)
    log_path = write_csv(out / "wheels.csv", COUNT_COLUMNS, counts)
    poses = _reference_poses(source, lidar_reference, log_path)
    write_csv(out / "reference.csv", POSE_COLUMNS, poses)
    return join_counts_and_poses(counts, poses)


def _drive(
    source: DriveSource, config: RobotConfig, options: CourseOptions, console: Console
) -> tuple[FloatArray, LidarReference | None]:
    """Drive the course; return the counts, and the reference if there is a lidar."""
    with open_board(source.board, config.board.baud) as board, progress_bar(console, "odometry") as bar:
        lidar = None
        if source.lidar:
            lidar = open_lidar(LidarOptions(model=source.lidar_model, port=source.lidar))
        try:
            reference = LidarReference(config, lidar) if lidar else None
            on_sample = reference.add_sample if reference else lambda _: None
            counts = drive_course(board, course(options), config.drive, bar, on_sample)
        finally:
            if lidar:
                lidar.close()
    return counts, reference


def _reference_poses(
    source: DriveSource, lidar_reference: LidarReference | None, log_path: Path
) -> FloatArray:
    if lidar_reference is not None:
        lidar_reference.check()
        return np.array(lidar_reference.rows)
    truth = simulated_truth(source.board)
    if truth is None:
        raise ThumperError(
            f"wrote {log_path}, but there is no reference for the robot's pose: pass --lidar PORT, or "
            f"--log {log_path} and --truth with a CSV ({', '.join(POSE_COLUMNS)}) on the same clock",
            exit_code=EXIT_USAGE,
        )
    return truth


def wheel_geometry(drive: DriveGeometry, track_m: float | None = None) -> WheelGeometry:
    """Return the configured geometry, or the same with another track."""
    return WheelGeometry(
        left_radius_m=drive.left_radius_m,
        right_radius_m=drive.right_radius_m,
        track_m=track_m or drive.track_m,
        counts_per_rev=drive.counts_per_rev,
    )


def run_odometry_experiment(
    log: WheelLog, config: RobotConfig, out: Path, console: Console
) -> dict[str, WheelComparison]:
    """Print *thesis | ours* for the thesis's track and the effective one, and draw figures 8.2 to 8.5."""
    runs = {
        f"ours, track {track_m:g} m": compare_wheel_speeds(log, wheel_geometry(config.drive, track_m))
        for track_m in (THESIS_TRACK_M, config.drive.track_m)
    }
    table = Table("encoder - reference, rad/s", "thesis", *runs)
    for side, wheel in enumerate(("left", "right")):
        errors = [run.error_rad_s[:, side] for run in runs.values()]
        mean, std = THESIS[wheel]
        table.add_row(f"{wheel} mean", f"{mean:+.3f}", *[f"{error.mean():+.3f}" for error in errors])
        table.add_row(f"{wheel} std", f"{std:+.3f}", *[f"{error.std():+.3f}" for error in errors])
    console.print(table)
    path = draw_odometry(runs, log, out / "odometry.png")
    console.print(f"wrote {path}; next: thumper calibrate odometry")
    return runs


def calibrate_odometry(log: WheelLog, config: RobotConfig, out: Path, console: Console) -> OdometryFit:
    """Fit on the first half of the drive, evaluate on the second, write odometry.toml, print before | after.

    Raises
    ------
    ThumperError
        The drive does not determine the geometry, or the robot was held.
    """
    half = len(log.time_s) // 2
    fitted, held_out = log.ticks(0, half), log.ticks(half, len(log.time_s))
    found = fit_geometry(fitted, config.drive.counts_per_rev)
    calibrated = _significant_changes(config.drive, found)
    geometry = found.geometry
    console.print(
        f"  left radius {1e3 * geometry.left_radius_m:.2f}, right "
        f"{1e3 * geometry.right_radius_m:.2f} +- {1e3 * found.radius_std_m:.2f} mm "
        f"(ratio {geometry.left_radius_m / geometry.right_radius_m:.4f} +- {found.ratio_std:.4f}); "
        f"effective track {1e3 * geometry.track_m:.1f} +- {1e3 * found.track_std_m:.1f} mm"
    )
    console.print(_evaluation_table(held_out, wheel_geometry(config.drive), wheel_geometry(calibrated)))
    path = out / "odometry.toml"
    write_text(
        path,
        f"[drive]\nwheel_radius_m = {calibrated.wheel_radius_m:g}\n"
        f"radius_ratio = {calibrated.radius_ratio:g}\ntrack_m = {calibrated.track_m:g}\n",
    )
    console.print(f"wrote {path}; copy its values into the robot's configuration")
    radius_mm = round(1e3 * calibrated.wheel_radius_m)
    if radius_mm != round(1e3 * config.drive.wheel_radius_m):
        console.print(f"note: the board uses another radius; set its parameter wheel_radius to {radius_mm}")
    return found


def _significant_changes(configured: DriveGeometry, found: OdometryFit) -> DriveGeometry:
    """Return the configured geometry with what differs significantly from it.

    Turns determine track over radius far better than distance determines the radius. So an insignificant
    change of the radius is dropped, and the track is scaled with it.
    """
    fitted = found.geometry
    radius_m = 0.5 * (fitted.left_radius_m + fitted.right_radius_m)
    ratio = fitted.left_radius_m / fitted.right_radius_m
    new_radius = abs(radius_m - configured.wheel_radius_m) > SIGNIFICANT_SIGMAS * found.radius_std_m
    new_ratio = abs(ratio - configured.radius_ratio) > SIGNIFICANT_SIGMAS * found.ratio_std
    kept_m = radius_m if new_radius else configured.wheel_radius_m
    return DriveGeometry(
        wheel_radius_m=round(kept_m, 5),
        radius_ratio=round(ratio, 5) if new_ratio else configured.radius_ratio,
        track_m=round(fitted.track_m * kept_m / radius_m, 4),
        counts_per_rev=configured.counts_per_rev,
    )


def _evaluation_table(held_out: WheelLog, before: WheelGeometry, after: WheelGeometry) -> Table:
    drifts = [odometry_drift(held_out, one) for one in (before, after)]
    if drifts[-1].window_heading_rad > MAX_HEADING_DRIFT_RAD:
        raise ThumperError(
            f"odometry drifted {np.degrees(drifts[-1].window_heading_rad):.0f} deg from the reference within "
            f"5 s, even after calibration: the robot was held, or the reference lost; keep {FLOOR} free",
            exit_code=EXIT_CHECK_FAILED,
        )
    errors = [compare_wheel_speeds(held_out, one).error_rad_s for one in (before, after)]
    table = Table("on the second half of the drive", "before", "after")
    table.add_row("position after 5 s, rms, m", *[f"{d.window_position_m:.3f}" for d in drifts])
    table.add_row("heading after 5 s, rms, deg", *[f"{np.degrees(d.window_heading_rad):.2f}" for d in drifts])
    table.add_row("position at the end, m", *[f"{d.end_position_m:.3f}" for d in drifts])
    table.add_row("heading at the end, deg", *[f"{np.degrees(d.end_heading_rad):.1f}" for d in drifts])
    table.add_row("left wheel, std, rad/s", *[f"{e[:, 0].std():.3f}" for e in errors])
    table.add_row("right wheel, std, rad/s", *[f"{e[:, 1].std():.3f}" for e in errors])
    return table
