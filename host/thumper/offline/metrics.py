"""Quality of a mapped path: errors against reference relations, or squareness of the walls."""

import gzip
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray
from thumper.lidar.deskew import HIT, scan_points
from thumper.offline.robot_log import RobotLog


@dataclass(frozen=True, slots=True, kw_only=True)
class RelationErrors:
    """One error per relation, shape (n,)."""

    translation_m: FloatArray
    rotation_rad: FloatArray


def load_relations(path: Path) -> FloatArray:
    """Read `i j dx dy dtheta` lines (scan numbers from 0), plain or .gz; shape (n, 5).

    Raises
    ------
    ThumperError
        The file cannot be read or is not a table of relations.
    """
    try:
        with gzip.open(path, "rt") if path.suffix == ".gz" else path.open() as stream:
            relations = np.loadtxt(stream, ndmin=2)
    except (OSError, ValueError) as error:
        raise ThumperError(f"{path}: not a table of relations ({error}); check the file") from error
    if relations.shape[1] != 5:
        raise ThumperError(f"{path}: {relations.shape[1]} columns; expected i j dx dy dtheta")
    return np.asarray(relations)


def relation_errors(poses: FloatArray, relations: FloatArray) -> RelationErrors:
    """Return the errors of the path's relative poses (Kuemmerle et al., Autonomous Robots 27(4), 2009).

    Parameters
    ----------
    poses : ndarray, shape (scans, 3)
        x, y, theta [m, m, rad] at each scan, in any frame.
    relations : ndarray, shape (n, 5)
        i, j and the true pose of scan j relative to scan i.
    """
    first, second = relations[:, 0].astype(int), relations[:, 1].astype(int)
    found = _relative(poses[first], poses[second])
    error = _relative(relations[:, 2:5], found)
    return RelationErrors(
        translation_m=np.hypot(error[:, 0], error[:, 1]),
        rotation_rad=np.abs((error[:, 2] + np.pi) % (2.0 * np.pi) - np.pi),
    )


def squareness(log: RobotLog, poses: FloatArray, usable_range_m: float = 4.0) -> float:
    """Return the resultant length of four times the direction of all walls, 0...1: 1 if all are parallel.

    In a building with square corners, the direction of a wall modulo 90 degrees is the same everywhere, so a
    bent path lowers the value. Furniture and noise keep it below 1, so compare only runs of the same log.
    """
    # A wall is 2 * span beams that hit a straight line of 0.1 to 0.6 m.
    span, total, weight = 4, 0.0 + 0.0j, 0.0
    for record, pose in zip(log.records[::5], poses[::5], strict=True):
        points = scan_points(record.scan, record.twist, log.base_from_laser, usable_range_m)
        hit = points.kinds == HIT
        start, middle, end = (
            points.ends_m[: -2 * span],
            points.ends_m[span:-span],
            points.ends_m[2 * span :],
        )
        chord, to_middle = end - start, middle - start
        length_m = np.hypot(chord[:, 0], chord[:, 1])
        cross = chord[:, 0] * to_middle[:, 1] - chord[:, 1] * to_middle[:, 0]
        wall = hit[: -2 * span] & hit[span:-span] & hit[2 * span :] & (length_m > 0.1) & (length_m < 0.6)
        wall &= np.abs(cross) < 0.02 * length_m
        direction_rad = np.arctan2(chord[wall, 1], chord[wall, 0]) + pose[2]
        total += complex(np.sum(length_m[wall] * np.exp(4j * direction_rad)))
        weight += float(length_m[wall].sum())
    return abs(total) / weight if weight else 0.0


def _relative(from_pose: FloatArray, to_pose: FloatArray) -> FloatArray:
    """Return inverse(from) * to, row by row; shape (n, 3), headings not wrapped."""
    cos, sin = np.cos(from_pose[:, 2]), np.sin(from_pose[:, 2])
    dx, dy = to_pose[:, 0] - from_pose[:, 0], to_pose[:, 1] - from_pose[:, 1]
    return np.column_stack((cos * dx + sin * dy, -sin * dx + cos * dy, to_pose[:, 2] - from_pose[:, 2]))
