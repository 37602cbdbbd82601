"""Glass: a lidar sees a pane only where its beams meet it squarely, and through it everywhere else.

What it sees is a short straight piece that moves along the pane as the robot moves. So a straight piece whose
both ends have moved along its own line is glass, and the pane goes on beyond them. It stays an obstacle until
a beam passes squarely through it (Foster et al., "VisAGGE: Visible Angle Grid for Glass Environments", ICRA
2013, also keep what was seen from one angle alone).
"""

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.field_of_view import FieldOfView
from thumper.navigation.costmap.ray_evidence import Evidence, ScanRays
from thumper.navigation.footprint import Footprint, outside_m

REACH_M = 1.2  # from the lidar: further away, the piece that is seen is longer, and most are not glass
GAP_M = 0.05  # neighbouring hits further apart belong to different pieces
BESIDE_RAD = math.radians(3.0)  # between neighbouring beams; in a wider gap, beams returned nothing
LEAST_POINTS, LEAST_RAD, LEAST_M = 6, math.radians(8.0), 0.03
MOST_RAD = math.radians(30.0)  # the most oblique beam that returns from glass or polished metal
STRAIGHT_M = 0.008  # rms of the hits' distances from the line; a leg or post is rounder
PIECES_S = 3.0  # pieces are compared with those that are at most so old
ON_LINE_M, MOVED_M = 0.03, 0.05  # a piece that has moved by so much along its line is on a pane
OVERLAP_M = 0.02  # without an overlap it may be another object on the same line
BEYOND_M = 0.2  # the pane goes on so far beyond what was seen of it; further on it will be seen in time
SQUARE_RAD = math.radians(6.0)  # a beam that is no more oblique would have returned from glass
CLEARING_M = 0.08  # its echo must come from so far behind the pane
SPACING_M = 0.02  # of the points that stand for a pane
BELOW_M = 0.04  # so far inside the outline, the robot is where the pane should be


@dataclass(frozen=True, slots=True)
class Piece:
    """A straight piece that a scan shows squarely."""

    time_s: float
    ends_m: FloatArray  # shape (2, 2)
    is_glass: bool


class Glass:
    """Finds panes of glass near the robot, and remembers them."""

    def __init__(self, view: FieldOfView, footprint: Footprint, radius_m: float) -> None:
        """Panes further from the lidar than `radius_m` are forgotten."""
        self._view = view
        self._half_planes = footprint.half_planes()
        self._radius_m = radius_m
        self._pieces: deque[Piece] = deque()
        self._normals: FloatArray = np.empty((0, 2))  # of the pane at each point, of length 1
        self.points_m: FloatArray = np.empty((0, 2))  # along the panes, shape (n, 2) in map

    def move(self, new_from_old: Pose2) -> None:
        """Move all that is remembered in the map."""
        turn = Pose2(theta_rad=new_from_old.theta_rad)
        self.points_m, self._normals = new_from_old.apply(self.points_m), turn.apply(self._normals)
        self._pieces = deque(replace(one, ends_m=new_from_old.apply(one.ends_m)) for one in self._pieces)

    def forget_beyond(self, map_from_base: Pose2, radius_m: float) -> None:
        """Forget panes further from the robot than `radius_m`."""
        self._keep(np.hypot(*(self.points_m - (map_from_base.x_m, map_from_base.y_m)).T) <= radius_m)

    def update(self, time_s: float, scan_pose: Pose2, hits_m: FloatArray) -> None:
        """Take a scan's hits, shape (n, 2) in map, in beam order, and the robot's pose at that time."""
        lidar = scan_pose @ self._view.base_from_laser
        self._forget(lidar, scan_pose, hits_m)
        while self._pieces and self._pieces[0].time_s < time_s - PIECES_S:
            self._pieces.popleft()
        half_rad = 0.5 * self._view.opening_rad
        earlier = list(self._pieces)
        for piece_m in square_pieces(lidar.inverse().apply(hits_m), half_rad):
            ends_m = lidar.apply(piece_m)
            same = [
                (one, moved_m) for one in earlier if (moved_m := _moved_m(one.ends_m, ends_m)) is not None
            ]
            is_glass = any(one.is_glass or moved_m >= MOVED_M for one, moved_m in same)
            if is_glass:
                self._add(np.vstack((ends_m, *(one.ends_m for one, _ in same))))
            self._pieces.append(Piece(time_s, ends_m, is_glass))

    def _add(self, seen_m: FloatArray) -> None:
        """Add the pane through the ends of the newest piece, first, and of earlier ones, shape (2 k, 2)."""
        start_m, along = seen_m[0], _unit(seen_m[1] - seen_m[0])
        way_m = (seen_m - start_m) @ along
        steps_m = np.arange(way_m.min() - BEYOND_M, way_m.max() + BEYOND_M, SPACING_M)
        pane_m = start_m + steps_m[:, None] * along
        old = np.hypot(*(self.points_m[:, None] - pane_m).transpose(2, 0, 1)).min(axis=1) > ON_LINE_M
        normals = np.tile((-along[1], along[0]), (len(pane_m), 1))
        self.points_m = np.vstack((self.points_m[old], pane_m))
        self._normals = np.vstack((self._normals[old], normals))

    def _forget(self, lidar: Pose2, scan_pose: Pose2, hits_m: FloatArray) -> None:
        """Forget what is far away, where the robot is, and what a beam has passed squarely."""
        if not len(self.points_m):
            return
        away_m = self.points_m - (lidar.x_m, lidar.y_m)
        distance_m = np.maximum(np.hypot(*away_m.T), 1e-9)
        square = np.abs(np.sum(away_m * self._normals, axis=1)) >= math.cos(SQUARE_RAD) * distance_m
        evidence = ScanRays(self._view, scan_pose, hits_m).evidence(self.points_m, CLEARING_M)
        below = outside_m(scan_pose.inverse().apply(self.points_m), self._half_planes) < -BELOW_M
        self._keep(~(square & (evidence == Evidence.PASSED)) & ~below & (distance_m <= self._radius_m))

    def _keep(self, kept: NDArray[np.bool_]) -> None:
        self.points_m, self._normals = self.points_m[kept], self._normals[kept]


def square_pieces(points_m: FloatArray, half_opening_rad: float) -> list[FloatArray]:
    """Return both ends, shape (2, 2), of each straight piece that glass might be.

    `points_m`, shape (n, 2), are a scan's hits in the frame of the lidar, in beam order. Neither something
    nearer nor the edge of view ends such a piece.
    """
    if len(points_m) < LEAST_POINTS:
        return []
    ranges_m, bearings_rad = np.hypot(*points_m.T), np.arctan2(points_m[:, 1], points_m[:, 0])
    gaps = np.hypot(*np.diff(points_m, axis=0).T) > GAP_M
    hides = np.append(np.abs(np.diff(bearings_rad)) < BESIDE_RAD, False)  # the one beside it
    starts = np.concatenate(([0], np.flatnonzero(gaps) + 1))
    lasts = np.append(starts[1:] - 1, len(points_m) - 1)
    befores, afters = starts - 1, np.minimum(lasts + 1, len(points_m) - 1)
    is_free = ~(hides[befores] & (ranges_m[befores] < ranges_m[starts]))
    is_free &= ~(hides[lasts] & (ranges_m[afters] < ranges_m[lasts]))
    is_free &= (
        np.maximum(np.abs(bearings_rad[starts]), np.abs(bearings_rad[lasts])) < half_opening_rad - BESIDE_RAD
    )
    near = np.minimum.reduceat(ranges_m, starts) <= REACH_M
    found = np.flatnonzero(is_free & near & (lasts - starts + 1 >= LEAST_POINTS))
    pieces = (_square_piece(points_m[starts[k] : lasts[k] + 1]) for k in found)
    return [ends_m for ends_m in pieces if ends_m is not None]


def _square_piece(points_m: FloatArray) -> FloatArray | None:
    """Return both ends of the line through points, if they are straight and all seen squarely."""
    middle_m = points_m.mean(axis=0)
    offset_m = points_m - middle_m
    xx, yy = np.mean(offset_m**2, axis=0)
    xy = np.mean(offset_m[:, 0] * offset_m[:, 1])
    angle_rad = 0.5 * math.atan2(2.0 * xy, xx - yy)
    along = np.array((math.cos(angle_rad), math.sin(angle_rad)))
    across = np.array((-along[1], along[0]))
    if np.mean((offset_m @ across) ** 2) > STRAIGHT_M**2:
        return None
    way_m = offset_m @ along
    ends_m = np.array((way_m.min(), way_m.max()))
    oblique_rad = np.arctan2(ends_m + middle_m @ along, abs(middle_m @ across))
    if np.abs(oblique_rad).max() > MOST_RAD or oblique_rad[1] - oblique_rad[0] < LEAST_RAD:
        return None
    if ends_m[1] - ends_m[0] < LEAST_M:
        return None
    return np.asarray(middle_m + ends_m[:, None] * along)


def _moved_m(earlier_m: FloatArray, ends_m: FloatArray) -> float | None:
    """Return how far both ends of an earlier piece, shape (2, 2), have moved along its line to be this one.

    None: it is another object.
    """
    length_m = math.dist(*ends_m)
    along = _unit(ends_m[1] - ends_m[0])
    offset_m = earlier_m - ends_m[0]
    first_m, last_m = np.sort(offset_m @ along)
    overlap_m = min(last_m, length_m) - max(first_m, 0.0)
    if np.abs(offset_m @ (-along[1], along[0])).max() > ON_LINE_M or overlap_m < OVERLAP_M:
        return None
    return float(max(0.0, min(-first_m, length_m - last_m), min(first_m, last_m - length_m)))


def _unit(vector: FloatArray) -> FloatArray:
    """Return a vector of length 1 in the same direction, shape (2,)."""
    return vector / max(1e-9, math.hypot(*vector))
