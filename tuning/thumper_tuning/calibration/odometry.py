"""Experiment 8.1 and the calibration: drive the course, compare with a reference, print, draw."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from rich.console import Console
from rich.table import Table

from thumper.common.errors import EXIT_CHECK_FAILED, EXIT_USAGE, ThumperError
from thumper.common.kinematics import DriveGeometry
from thumper.config.robot import RobotConfig
from thumper.lidar.open_lidar import open_lidar
from thumper.lidar.options import LidarOptions
from thumper_tuning.calibration.course import FLOOR, CourseOptions, course
from thumper_tuning.calibration.drive_course import drive
from thumper_tuning.calibration.figures import draw_odometry
from thumper_tuning.calibration.odometry_fit import Calibration, calibrate, drift
from thumper_tuning.calibration.reference_path import LidarReference, simulated_truth
from thumper_tuning.calibration.wheel_log import (
    COUNT_COLUMNS,
    POSE_COLUMNS,
    WheelLog,
    joined,
    read_csv,
    write_csv,
)
from thumper_tuning.calibration.wheel_truth import WheelComparison, WheelGeometry, compare
from thumper_tuning.cli.steps import bar, confirm_room, opened

THESIS = {"left": (0.796, 0.879), "right": (-0.427, 0.645)}  # mean, std [rad/s], table 8.1
BLOCKED_RAD = 0.35  # no slip of free wheels turns odometry so far in 5 s
THESIS_TRACK_M = 0.245  # between the contact points of the middle wheels


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """Where a drive and its reference come from: a board (with a lidar), or files."""

    board: str
    lidar: str = ""
    lidar_model: Literal["urg04lx", "ld19"] = "urg04lx"
    log: Path | None = None
    truth: Path | None = None


def gather(
    source: Source, config: RobotConfig, options: CourseOptions, out: Path, *, yes: bool, console: Console
) -> WheelLog:
    """Drive, or read the files; leave wheels.csv and reference.csv in `out`.

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
        return joined(read_csv(source.log, COUNT_COLUMNS), read_csv(source.truth, POSE_COLUMNS))
    if source.truth is not None:
        raise ThumperError(
            "--truth belongs to --log: a drive has a reference of its own", exit_code=EXIT_USAGE
        )
    confirm_room(f"floor of {FLOOR}", console, yes=yes)
    with opened(source.board) as board, bar(console, "odometry") as show:
        lidar = None
        if source.lidar:
            lidar = open_lidar(LidarOptions(model=source.lidar_model, port=source.lidar))
        try:
            by_lidar = LidarReference(config, lidar) if lidar else None
            look = by_lidar.tick if by_lidar else lambda _: None
            counts = drive(board, course(options), config.drive, show, look)
        finally:
            if lidar:
                lidar.close()
    log_path = write_csv(out / "wheels.csv", COUNT_COLUMNS, counts)
    if by_lidar:
        by_lidar.check()
        poses = np.array(by_lidar.rows)
    else:
        truth = simulated_truth(source.board)
        if truth is None:
            raise ThumperError(
                f"{log_path} is there, but nothing says where the robot was: give --lidar PORT, or "
                f"--log {log_path} and --truth with a CSV ({', '.join(POSE_COLUMNS)}) on the same clock",
                exit_code=EXIT_USAGE,
            )
        poses = truth
    write_csv(out / "reference.csv", POSE_COLUMNS, poses)
    return joined(counts, poses)


def geometry_of(drive_geometry: DriveGeometry, track_m: float | None = None) -> WheelGeometry:
    """The configuration's geometry, or the same with another track."""
    return WheelGeometry(
        left_radius_m=drive_geometry.left_radius_m,
        right_radius_m=drive_geometry.right_radius_m,
        track_m=track_m or drive_geometry.track_m,
        counts_per_rev=drive_geometry.counts_per_rev,
    )


def experiment(log: WheelLog, config: RobotConfig, out: Path, console: Console) -> dict[str, WheelComparison]:
    """Print *thesis | ours* for the thesis's track and for the effective one, and draw figures 8.2 to 8.5."""
    runs = {
        f"ours, track {track_m:g} m": compare(log, geometry_of(config.drive, track_m))
        for track_m in (THESIS_TRACK_M, config.drive.track_m)
    }
    table = Table("encoder - reference, rad/s", "thesis", *runs)
    for side, name in enumerate(("left", "right")):
        for part, what in enumerate(("mean", "std")):
            ours = [
                f"{(run.error_rad_s[:, side].mean(), run.error_rad_s[:, side].std())[part]:+.3f}"
                for run in runs.values()
            ]
            table.add_row(f"{name} {what}", f"{THESIS[name][part]:+.3f}", *ours)
    console.print(table)
    path = draw_odometry(runs, log, out / "odometry.png")
    console.print(f"{path} shows it; next: thumper calibrate odometry")
    return runs


def calibration(log: WheelLog, config: RobotConfig, out: Path, console: Console) -> Calibration:
    """Fit on the first half of the drive, judge on the second, write odometry.toml, print before | after."""
    half = len(log.time_s) // 2
    fitted, held_out = log.part(0, half), log.part(half, len(log.time_s))
    found = calibrate(fitted, config.drive.counts_per_rev)
    radius_m = 0.5 * (found.geometry.left_radius_m + found.geometry.right_radius_m)
    # The turns tell track over radius far better than the way tells the radius: a radius that cannot be told
    # from the configured one stays, and the track goes with it.
    told = abs(radius_m - config.drive.wheel_radius_m) > 2.0 * found.radius_std_m
    kept_m = radius_m if told else config.drive.wheel_radius_m
    ratio = found.geometry.left_radius_m / found.geometry.right_radius_m
    unlike = abs(ratio - config.drive.radius_ratio) > 2.0 * found.ratio_std
    written = DriveGeometry(
        wheel_radius_m=round(kept_m, 5),
        radius_ratio=round(ratio, 5) if unlike else config.drive.radius_ratio,
        track_m=round(found.geometry.track_m * kept_m / radius_m, 4),
        counts_per_rev=config.drive.counts_per_rev,
    )
    console.print(
        f"  left radius {1e3 * found.geometry.left_radius_m:.2f}, right "
        f"{1e3 * found.geometry.right_radius_m:.2f} +- {1e3 * found.radius_std_m:.2f} mm "
        f"(ratio {ratio:.4f} +- {found.ratio_std:.4f}); "
        f"effective track {1e3 * found.geometry.track_m:.1f} +- {1e3 * found.track_std_m:.1f} mm"
    )
    before, after = geometry_of(config.drive), geometry_of(written)
    table = Table("on the second half of the drive", "before", "after")
    drifts = [drift(held_out, one) for one in (before, after)]
    if drifts[-1].window_heading_rad > BLOCKED_RAD:
        raise ThumperError(
            f"within 5 s odometry turned {np.degrees(drifts[-1].window_heading_rad):.0f} deg from the "
            f"reference, calibrated or not: the robot was held, or the reference lost; {FLOOR} must be free",
            exit_code=EXIT_CHECK_FAILED,
        )
    errors = [compare(held_out, one).error_rad_s for one in (before, after)]
    table.add_row("position after 5 s, rms, m", *[f"{d.window_position_m:.3f}" for d in drifts])
    table.add_row("heading after 5 s, rms, deg", *[f"{np.degrees(d.window_heading_rad):.2f}" for d in drifts])
    table.add_row("position at the end, m", *[f"{d.end_position_m:.3f}" for d in drifts])
    table.add_row("heading at the end, deg", *[f"{np.degrees(d.end_heading_rad):.1f}" for d in drifts])
    table.add_row("left wheel, std, rad/s", *[f"{e[:, 0].std():.3f}" for e in errors])
    table.add_row("right wheel, std, rad/s", *[f"{e[:, 1].std():.3f}" for e in errors])
    console.print(table)
    path = out / "odometry.toml"
    path.write_text(
        f"[drive]\nwheel_radius_m = {written.wheel_radius_m:g}\nradius_ratio = {written.radius_ratio:g}\n"
        f"track_m = {written.track_m:g}\n",
        encoding="utf-8",
    )
    console.print(f"{path} holds the new values; copy them into the robot's configuration")
    if round(1e3 * written.wheel_radius_m) != round(1e3 * config.drive.wheel_radius_m):
        console.print("note: the firmware counts with the old radius: build it anew with the new one")
    return found
