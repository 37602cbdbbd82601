"""Least squares for wheel radii and effective track against reference poses. Pure functions.

The heading change over a stretch is (rR/l) phiR - (rL/l) phiL, linear in the two ratios. With these known,
the distance along the mean heading is l/2 ((rL/l) phiL + (rR/l) phiR), linear in l (Antonelli, Chiaverini and
Fusco, "A calibration method for odometry of mobile robots based on the least-squares technique", IEEE
Transactions on Robotics 21 (5), 2005).
"""

import math
from dataclasses import dataclass

import numpy as np

from thumper.common.errors import EXIT_CHECK_FAILED, ThumperError
from thumper.common.geometry import FloatArray, Pose2
from thumper.odometry.wheel_odometry import advance
from thumper_tuning.calibration.wheel_log import WheelLog
from thumper_tuning.calibration.wheel_truth import WheelGeometry

STRETCH_TICKS = 5  # half a second: much longer than a scan's time error, still nearly an arc
MIN_TURN_RAD, MIN_DISTANCE_M = 6.0, 1.5


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryFit:
    """The fitted geometry, with one standard deviation each."""

    geometry: WheelGeometry
    radius_std_m: float  # of the mean radius
    ratio_std: float  # of left over right
    track_std_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryDrift:
    """Deviation of odometry from the reference: over windows of 5 s, and at the end."""

    window_position_m: float  # root mean square
    window_heading_rad: float  # root mean square
    end_position_m: float
    end_heading_rad: float


def fit_geometry(log: WheelLog, counts_per_rev: float) -> OdometryFit:
    """Fit radii and track.

    Raises
    ------
    ThumperError
        The drive turns or travels too little, or an encoder is reversed.
    """
    pose = log.poses_at_ticks()[::STRETCH_TICKS]
    scale = math.tau / counts_per_rev
    left = scale * np.diff(log.left_counts[::STRETCH_TICKS])
    right = scale * np.diff(log.right_counts[::STRETCH_TICKS])
    turn = np.diff(pose[:, 2])
    middle = 0.5 * (pose[1:, 2] + pose[:-1, 2])
    along = np.diff(pose[:, 0]) * np.cos(middle) + np.diff(pose[:, 1]) * np.sin(middle)
    along /= np.sinc(0.5 * turn / np.pi)
    if np.abs(turn).sum() < MIN_TURN_RAD or np.abs(along).sum() < MIN_DISTANCE_M:
        raise ThumperError(
            f"the drive turned {np.abs(turn).sum():.1f} rad and travelled {np.abs(along).sum():.1f} m: "
            f"too little; drive at least {MIN_TURN_RAD:g} rad and {MIN_DISTANCE_M:g} m",
            exit_code=EXIT_CHECK_FAILED,
        )
    ratios, ratio_std = _solve(np.column_stack((-left, right)), turn)
    (track,), (track_std,) = _solve((0.5 * (ratios[0] * left + ratios[1] * right))[:, None], along)
    radii = track * ratios
    if not (track > 0.0 and (radii > 0.0).all()):
        raise ThumperError(
            "the wheels and the reference turn in opposite directions; check for a reversed encoder",
            exit_code=EXIT_CHECK_FAILED,
        )
    return OdometryFit(
        geometry=WheelGeometry(
            left_radius_m=float(radii[0]),
            right_radius_m=float(radii[1]),
            track_m=float(track),
            counts_per_rev=counts_per_rev,
        ),
        # The distance determines the scale of radii and track; the ratios, the rest of the track.
        radius_std_m=float(radii.mean() * track_std / track),
        ratio_std=float(ratios[0] / ratios[1] * np.hypot(*(ratio_std / ratios))),
        track_std_m=float(math.hypot(track_std, track * ratio_std.max() / ratios.mean())),
    )


def _solve(matrix: FloatArray, right_side: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the least-squares solution and the standard deviations of the unknowns."""
    solution = np.linalg.lstsq(matrix, right_side, rcond=None)[0]
    residual = right_side - matrix @ solution
    variance = float(residual @ residual) / (len(right_side) - matrix.shape[1])
    return np.asarray(solution), np.sqrt(variance * np.diag(np.linalg.inv(matrix.T @ matrix)))


def odometry_drift(log: WheelLog, geometry: WheelGeometry, window_s: float = 5.0) -> OdometryDrift:
    """Dead-reckon with the geometry and compare with the reference."""
    left = np.diff(log.left_counts) * math.tau * geometry.left_radius_m / geometry.counts_per_rev
    right = np.diff(log.right_counts) * math.tau * geometry.right_radius_m / geometry.counts_per_rev
    arcs = 0.5 * (left + right)
    turns = (right - left) / geometry.track_m
    pose, reckoned = Pose2(), [Pose2()]
    for arc_m, turn_rad in zip(arcs.tolist(), turns.tolist(), strict=True):
        pose = advance(pose, arc_m, turn_rad)
        reckoned.append(pose)
    truth = [Pose2(x_m=x, y_m=y, theta_rad=theta) for x, y, theta in log.poses_at_ticks().tolist()]
    ticks = max(round(window_s / float(np.median(np.diff(log.time_s)))), 1)
    windows = range(0, len(truth) - ticks, ticks)
    errors = [_motion_error(truth[k], truth[k + ticks], reckoned[k], reckoned[k + ticks]) for k in windows]
    end = _motion_error(truth[0], truth[-1], reckoned[0], reckoned[-1])
    errors = errors or [end]
    return OdometryDrift(
        window_position_m=math.sqrt(sum(position**2 for position, _ in errors) / len(errors)),
        window_heading_rad=math.sqrt(sum(heading**2 for _, heading in errors) / len(errors)),
        end_position_m=end[0],
        end_heading_rad=abs(end[1]),
    )


def _motion_error(true_start: Pose2, true_end: Pose2, start: Pose2, end: Pose2) -> tuple[float, float]:
    """Return the differences in distance [m] and turn [rad] between two motions."""
    difference = (true_start.inverse() @ true_end).inverse() @ (start.inverse() @ end)
    return math.hypot(difference.x_m, difference.y_m), difference.theta_rad
