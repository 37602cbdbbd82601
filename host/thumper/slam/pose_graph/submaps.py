"""Submaps: a few metres of path each with the scans inserted there, connected in a pose graph."""

import heapq
import math
from array import array
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.deskew import INVALID, KindArray, ScanPoints
from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.pose_arrays import compose_rows
from thumper.slam.pose_graph.optimizer import Edge

SUBMAP_LENGTH_M = 2.0  # path within one submap: its scans move as one
# An old submap this close, matched against in the active map, gets an edge to the new one.
NEIGHBOUR_DISTANCE_M = 3.0
ODOMETRY_STD_M, ODOMETRY_STD_RAD = 0.01, 0.002  # of one submap's path: what a scan matcher loses in 2 m
LOOP_STD_M, LOOP_STD_RAD = 0.02, 0.004
# Path length that a turn of 1 rad counts as: turning drifts, too.
METRES_PER_RAD = 0.3
MAX_KEPT_SCANS = 16_000  # about 100 MB with a lidar of 400 beams, and a path of more than a kilometre


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeScan:
    """An inserted scan, in single precision: a long drive keeps thousands."""

    submap: int
    submap_from_base: Pose2
    origins_m: NDArray[np.float32]  # shape (n, 2), or (1, 2) if the robot was stationary during the scan
    ends_m: NDArray[np.float32]
    kinds: KindArray

    def points(self) -> ScanPoints:
        """Return the valid beams."""
        return ScanPoints(
            origins_m=np.broadcast_to(self.origins_m, self.ends_m.shape).astype(np.float64),
            ends_m=self.ends_m.astype(np.float64),
            kinds=self.kinds,
        )


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
    _neighbours: list[list[tuple[int, float]]] = field(default_factory=list)
    _started_at_m: list[float] = field(default_factory=list)

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

    def add(self, map_from_base: Pose2, points: ScanPoints | None) -> bool:
        """Add a scan's pose, and its beams if it was inserted; return whether a new submap has started."""
        if self._last is not None:
            step = self._last.inverse() @ map_from_base
            self.driven_m += math.hypot(step.x_m, step.y_m) + METRES_PER_RAD * abs(step.theta_rad)
        self._last = map_from_base
        started = self.newest < 0 or (
            points is not None and self.driven_m - self._started_at_m[-1] >= SUBMAP_LENGTH_M
        )
        if started:
            self._start_submap(map_from_base)
        relative = self.pose(self.newest).inverse() @ map_from_base
        self._relative.extend((self.newest, relative.x_m, relative.y_m, relative.theta_rad))
        if points is not None:
            self._keep_scan(relative, points)
        return started

    def _keep_scan(self, submap_from_base: Pose2, points: ScanPoints) -> None:
        valid = points.kinds != INVALID
        self.scans.append(
            NodeScan(
                submap=self.newest,
                submap_from_base=submap_from_base,
                origins_m=_compact(points.origins_m[valid].astype(np.float32)),
                ends_m=points.ends_m[valid].astype(np.float32),
                kinds=points.kinds[valid],
            )
        )
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
        length_m = math.hypot(first_from_second.x_m, first_from_second.y_m)
        edge = Edge(
            first=first,
            second=second,
            first_from_second=first_from_second,
            std_m=std_m,
            std_rad=std_rad,
            loop=loop,
            length_m=length_m,
        )
        self.edges.append(edge)
        self._neighbours[first].append((second, length_m))
        self._neighbours[second].append((first, length_m))

    def connect_to_nearest(self, near: dict[int, float]) -> None:
        """Connect the submap just finished to the nearest old one in the active map.

        Both were matched against the same map, so their relative pose is known. Without the edge a later loop
        could pull them apart.
        """
        submap = self.newest - 1
        if submap < 1:
            return
        here = self.pose(submap)
        old = [s for s in near if s < submap and self.path_length_m(s, submap) > 4.0 * SUBMAP_LENGTH_M]
        if not old:
            return
        nearest = min(old, key=lambda s: self.pose(s).distance_m(here))
        if self.pose(nearest).distance_m(here) < NEIGHBOUR_DISTANCE_M:
            self.connect(nearest, submap, self.pose(nearest).inverse() @ here, loop=True)

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

    def insert_scans(self, hit_grid: HitGrid, start: int, chosen: set[int] | None, max_scans: int) -> int:
        """Insert up to `max_scans` kept scans from number `start` on, of the chosen submaps (None: all).

        Returns the number of the first scan not looked at.
        """
        inserted = 0
        for number in range(start, len(self.scans)):
            scan = self.scans[number]
            if scan is not None and (chosen is None or scan.submap in chosen):
                if inserted == max_scans:
                    return number
                hit_grid.insert(self.pose(scan.submap) @ scan.submap_from_base, scan.points())
                inserted += 1
        return len(self.scans)

    def path(self) -> FloatArray:
        """Return x, y, theta at each scan, shape (scans, 3)."""
        rows = np.array(self._relative).reshape(-1, 4)
        return compose_rows(self.poses[rows[:, 0].astype(np.int64)], rows[:, 1:])

    def _start_submap(self, map_from_base: Pose2) -> None:
        row = np.array([[map_from_base.x_m, map_from_base.y_m, map_from_base.theta_rad]])
        self.poses = np.concatenate((self.poses, row))
        self._neighbours.append([])
        self._started_at_m.append(self.driven_m)
        if self.newest > 0:
            before = self.newest - 1
            self.connect(before, self.newest, self.pose(before).inverse() @ map_from_base, loop=False)


def _pose(row: FloatArray) -> Pose2:
    x_m, y_m, theta_rad = (float(value) for value in row)
    return Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)


def _compact(origins_m: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return one row if all rows are equal, else all rows."""
    return origins_m[:1].copy() if (origins_m == origins_m[:1]).all() else origins_m
