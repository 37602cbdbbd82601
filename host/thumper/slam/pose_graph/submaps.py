"""Submaps: a few metres of path each with the scans inserted there, connected in a pose graph."""

import heapq
import math
from array import array
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.deskew import ScanPoints
from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.pose_arrays import compose_rows
from thumper.slam.pose_graph.kept_scan import NodeScan, keep_scan
from thumper.slam.pose_graph.optimizer import Edge
from thumper.slam.scan_matching.degeneracy import weakest_direction
from thumper.slam.scan_matching.pose_covariance import ERROR_PER_M

SUBMAP_LENGTH_M = 2.0  # path within one submap: its scans move as one
# An old submap this close, matched against in the active map, gets an edge to the new one.
NEIGHBOUR_DISTANCE_M = 3.0
ODOMETRY_STD_M, ODOMETRY_STD_RAD = 0.01, 0.002  # of one submap's path: what a scan matcher loses in 2 m
LOOP_STD_M, LOOP_STD_RAD = 0.02, 0.004
# Along the direction that the walls constrain least, the match follows the wheels: fully where no wall
# faces it, and not at all from this share of the visible walls on.
FREE_SHARE = 0.2
# Path length that a turn of 1 rad counts as: turning drifts, too.
METRES_PER_RAD = 0.3
OVERLAP_SUBMAPS = 4  # before and after an old submap, whose walls are compared with those of the new one
NEW_HITS, OLD_HITS, HITS_PER_SCAN = 300, 2000, 50  # compared
SAME_WALL_M, COMPARED_M = 0.15, 1.0  # hits about this close are the same wall; are compared
MAX_KEPT_SCANS = 16_000  # about 100 MB with a lidar of 400 beams, and a path of more than a kilometre


@dataclass(slots=True)
class SubmapGraph:
    """Submaps, their scans, and the edges between them."""

    poses: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    edges: list[Edge] = field(default_factory=list)
    scans: list[NodeScan | None] = field(default_factory=list)  # in driving order; None: dropped
    driven_m: float = 0.0
    _last: Pose2 | None = None
    _relative: "array[float]" = field(default_factory=lambda: array("d"))  # submap, x, y, theta of each scan
    _kept_scans: int = 0
    _since_kept_m: float = 0.0  # way since the last kept scan
    _neighbours: list[list[tuple[int, float]]] = field(default_factory=list)
    _started_at_m: list[float] = field(default_factory=list)
    _first_scan: list[int] = field(default_factory=list)  # number of each submap's first kept scan
    # Standard deviation of each submap's own path where walls constrain it badly: sums of s u u^T, with the
    # direction u in the submap's frame and the error s [m] of the wheels.
    _slack_m: list[FloatArray] = field(default_factory=list)

    @property
    def newest(self) -> int:
        """Number of the submap that the robot is in."""
        return int(self.poses.shape[0]) - 1

    def pose(self, submap: int) -> Pose2:
        """Return `map_from_submap`."""
        return _pose(self.poses[submap])

    def path_length_m(self, first: int, second: int) -> float:
        """Return the distance driven between two submaps [m]."""
        return abs(self._started_at_m[first] - self._started_at_m[second])

    def path_lengths_m(self, submaps: NDArray[np.int64], last: int) -> FloatArray:
        """Return the distance driven between each of the submaps and the last one [m]."""
        return np.abs(np.array(self._started_at_m)[submaps] - self._started_at_m[last])

    def add(self, map_from_base: Pose2, points: ScanPoints | None) -> bool:
        """Add a scan's pose, and its beams if it was inserted; return whether a new submap has started."""
        step_m = 0.0
        if self._last is not None:
            step = self._last.inverse() @ map_from_base
            step_m = math.hypot(step.x_m, step.y_m)
            self.driven_m += step_m + METRES_PER_RAD * abs(step.theta_rad)
        self._last = map_from_base
        started = self.newest < 0 or (
            points is not None and self.driven_m - self._started_at_m[-1] >= SUBMAP_LENGTH_M
        )
        if started:
            self._start_submap(map_from_base)
        relative = self.pose(self.newest).inverse() @ map_from_base
        self._relative.extend((self.newest, relative.x_m, relative.y_m, relative.theta_rad))
        self._since_kept_m += step_m
        if points is not None:
            self._keep_scan(relative, points)
            self._add_slack(relative, points)
        return started

    def _add_slack(self, submap_from_base: Pose2, points: ScanPoints) -> None:
        """Add the error of the way since the last kept scan along the weakest direction of this one."""
        x, y, share = weakest_direction(points.hits_m)
        std_m, self._since_kept_m = ERROR_PER_M * self._since_kept_m * max(0.0, 1.0 - share / FREE_SHARE), 0.0
        if std_m > 0.0:
            cos, sin = math.cos(submap_from_base.theta_rad), math.sin(submap_from_base.theta_rad)
            direction = np.array([cos * x - sin * y, sin * x + cos * y])
            self._slack_m[-1] += std_m * np.outer(direction, direction)

    def _keep_scan(self, submap_from_base: Pose2, points: ScanPoints) -> None:
        self.scans.append(keep_scan(self.newest, submap_from_base, points))
        self._kept_scans += 1
        if self._kept_scans > MAX_KEPT_SCANS:
            self._thin_out()

    def _thin_out(self) -> None:
        """Drop every second scan of the older half: a long drive has seen its places many times."""
        kept = [number for number, scan in enumerate(self.scans) if scan is not None]
        for number in kept[: len(kept) // 2 : 2]:
            self.scans[number] = None
            self._kept_scans -= 1

    def connect(self, first: int, second: int, first_from_second: Pose2, *, loop: bool) -> None:
        """Add an edge from a loop closure, or from a match in the active map."""
        std_m, std_rad = (LOOP_STD_M, LOOP_STD_RAD) if loop else (ODOMETRY_STD_M, ODOMETRY_STD_RAD)
        covariance = np.diag([std_m**2, std_m**2, std_rad**2])
        slack_m = self._slack_m[first]
        if not loop:
            covariance[:2, :2] += slack_m @ slack_m
        length_m = math.hypot(first_from_second.x_m, first_from_second.y_m)
        edge = Edge(
            first=first,
            second=second,
            first_from_second=first_from_second,
            information=np.linalg.inv(covariance),
            loop=loop,
            length_m=length_m,
        )
        self.edges.append(edge)
        self._neighbours[first].append((second, length_m))
        self._neighbours[second].append((first, length_m))

    def connect_to_nearest(self, near: dict[int, float], accept_score: float) -> None:
        """Connect the submap just finished to the nearest old one in the active map, if their walls agree.

        Both were matched against the same map, so their relative pose is known. Without the edge a later loop
        could pull them apart. Where the map has drifted by more than the matcher's basin, the new walls lie
        beside the old ones: then only a search knows the relative pose.
        """
        submap = self.newest - 1
        if submap < 1:
            return
        old = np.array([s for s in near if s < submap], dtype=np.int64)
        old = old[self.path_lengths_m(old, submap) > 4.0 * SUBMAP_LENGTH_M]
        if not old.size:
            return
        apart_m = np.hypot(*(self.poses[old, :2] - self.poses[submap, :2]).T)
        nearest = int(old[np.argmin(apart_m)])
        if apart_m.min() < NEIGHBOUR_DISTANCE_M and self.agreement(nearest, submap) >= accept_score:
            self.connect(nearest, submap, self.pose(nearest).inverse() @ self.pose(submap), loop=True)

    def agreement(self, old: int, new: int) -> float:
        """Return which share of the new submap's walls lies on those seen from around the old one.

        NaN if they show nothing alike, as after most scans of an old visit were dropped.
        """
        last = min(old + OVERLAP_SUBMAPS, new - OVERLAP_SUBMAPS)
        new_m = self.hits_m(new - OVERLAP_SUBMAPS // 2, new, NEW_HITS)
        return agreement(new_m, self.hits_m(old - OVERLAP_SUBMAPS, last, OLD_HITS))

    def hits_m(self, first: int, last: int, count: int) -> FloatArray:
        """Return about `count` hits of submaps `first` to `last` in the map, shape (n, 2)."""
        scans = self.scans_of(first, last)
        chosen = scans[:: math.ceil(len(scans) * HITS_PER_SCAN / count)] if scans else []
        parts = [np.zeros((0, 2))]
        for scan in chosen:
            map_from_base = self.pose(scan.submap) @ scan.submap_from_base
            parts.append(scan.thinned_hits_m(map_from_base, count / len(chosen)))
        return np.concatenate(parts)

    def within(self, distance_m: float) -> dict[int, float]:
        """Return the submaps within this distance of the newest along the graph, with it [m] (Dijkstra)."""
        if self.newest < 0:
            return {}
        found: dict[int, float] = {}
        queue = [(0.0, self.newest)]
        while queue:
            length_m, submap = heapq.heappop(queue)
            if submap in found:
                continue
            found[submap] = length_m
            for other, edge_m in self._neighbours[submap]:
                if other not in found and length_m + edge_m <= distance_m:
                    heapq.heappush(queue, (length_m + edge_m, other))
        return found

    def apply_correction(self, poses: FloatArray) -> None:
        """Replace the poses of the first submaps, shape (n, 3); newer submaps move with the last of them."""
        n = len(poses)
        correction = _pose(poses[-1]) @ self.pose(n - 1).inverse()
        newer = [correction @ self.pose(submap) for submap in range(n, self.newest + 1)]
        rows = np.array([(p.x_m, p.y_m, p.theta_rad) for p in newer]).reshape(-1, 3)
        self.poses = np.concatenate((poses, rows))
        if self._last is not None:
            submap, x_m, y_m, theta_rad = self._relative[-4:]
            self._last = self.pose(int(submap)) @ Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)

    def insert_scans(
        self, hit_grid: HitGrid, start: int, chosen: set[int] | None, way_m: float, range_m: float
    ) -> tuple[int, float]:
        """Insert kept scans from number `start` on, of the chosen submaps (None: all), beams up to `range_m`.

        Stops when the beams inserted are `way_m` long together; the last scan may exceed it. Returns the
        number of the first scan not looked at, and what is left of `way_m`.
        """
        if chosen:
            start = max(start, self._first_scan[min(chosen)])
        for number in range(start, len(self.scans)):
            scan = self.scans[number]
            if scan is not None and (chosen is None or scan.submap in chosen):
                if way_m <= 0.0:
                    return number, way_m
                points = scan.points(range_m)
                hit_grid.insert(self.pose(scan.submap) @ scan.submap_from_base, points)
                way_m -= points.length_m()
        return len(self.scans), way_m

    def scans_of(self, first: int, last: int) -> list[NodeScan]:
        """Return the kept scans of submaps `first` to `last`."""
        end = len(self.scans) if last >= self.newest else self._first_scan[last + 1]
        return [scan for scan in self.scans[self._first_scan[max(0, first)] : end] if scan is not None]

    def path(self) -> FloatArray:
        """Return x, y, theta at each scan, shape (scans, 3)."""
        rows = np.array(self._relative).reshape(-1, 4)
        return compose_rows(self.poses[rows[:, 0].astype(np.int64)], rows[:, 1:])

    def _start_submap(self, map_from_base: Pose2) -> None:
        row = np.array([[map_from_base.x_m, map_from_base.y_m, map_from_base.theta_rad]])
        self.poses = np.concatenate((self.poses, row))
        self._neighbours.append([])
        self._started_at_m.append(self.driven_m)
        self._first_scan.append(len(self.scans))
        self._slack_m.append(np.zeros((2, 2)))
        if self.newest > 0:
            before = self.newest - 1
            self.connect(before, self.newest, self.pose(before).inverse() @ map_from_base, loop=False)


def agreement(new_m: FloatArray, old_m: FloatArray) -> float:
    """Return which share of the new hits, shape (n, 2), lies on old walls, shape (m, 2); NaN if none is near.

    Only hits near an old one count: the others show what was not seen before.
    """
    near = int(_is_near(new_m, old_m, COMPARED_M).sum())
    return float(_is_near(new_m, old_m, SAME_WALL_M).sum()) / near if near else math.nan


def _is_near(points_m: FloatArray, others_m: FloatArray, size_m: float) -> NDArray[np.bool_]:
    """Return which points have another point in their cell of this size, or in one next to it."""
    if not len(others_m):
        return np.zeros(len(points_m), np.bool_)
    cells, others = (np.floor(each_m / size_m).astype(np.int64) for each_m in (points_m, others_m))
    keys = np.sort(others @ (1 << 32, 1))  # three neighbours in one column follow each other
    lowest = (cells[:, np.newaxis] + ((-1, -1), (0, -1), (1, -1))) @ (1 << 32, 1)
    found = np.searchsorted(keys, lowest).clip(max=len(keys) - 1)
    between = (keys[found] >= lowest) & (keys[found] <= lowest + 2)
    return np.asarray(between.any(axis=1))


def _pose(row: FloatArray) -> Pose2:
    x_m, y_m, theta_rad = row.tolist()
    return Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)
