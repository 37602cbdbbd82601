"""The places of a drive: a few metres of way each, with the scans entered there, tied into a pose graph."""

import heapq
import math
from array import array
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.deskew import INVALID, KindArray, ScanPoints
from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.pose_graph.optimizer import Edge

TIE_EVERY_M = 3.0  # an old place this near, matched against in the active map, is tied to the new one
CHAIN_STD_M, CHAIN_STD_RAD = 0.01, 0.002  # of one place's way: what a scan matcher loses in 2 m
TIE_STD_M, TIE_STD_RAD = 0.02, 0.004
MOST_KEPT = 16_000  # scans: some 100 MB of a lidar of 400 beams, or a kilometre and more of way


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeScan:
    """An entered scan, in single precision: a long drive keeps thousands."""

    place: int
    place_from_base: Pose2
    origins_m: NDArray[np.float32]  # shape (n, 2), or (1, 2) where the robot stood during the turn
    ends_m: NDArray[np.float32]
    kinds: KindArray

    def points(self) -> ScanPoints:
        """The beams that said something."""
        return ScanPoints(
            origins_m=np.broadcast_to(self.origins_m, self.ends_m.shape).astype(np.float64),
            ends_m=self.ends_m.astype(np.float64),
            kinds=self.kinds,
        )


@dataclass(slots=True)
class SubmapGraph:
    """Places, their scans, and the edges between them."""

    place_m: float
    poses: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    edges: list[Edge] = field(default_factory=list)
    scans: list[NodeScan | None] = field(default_factory=list)  # in the order of the drive; None was thinned
    driven_m: float = 0.0
    _last: Pose2 | None = None
    _relative: "array[float]" = field(default_factory=lambda: array("d"))  # place, x, y, theta of each scan
    _kept: int = 0
    _neighbours: list[list[tuple[int, float]]] = field(default_factory=list)
    _began_at_m: list[float] = field(default_factory=list)

    @property
    def newest(self) -> int:
        """Number of the place that the robot is in."""
        return int(self.poses.shape[0]) - 1

    def pose(self, place: int) -> Pose2:
        """`map_from_place`."""
        return _pose(self.poses[place])

    def way_m(self, one: int, two: int) -> float:
        """How far the robot drove between two places [m]."""
        return abs(self._began_at_m[one] - self._began_at_m[two])

    def add(self, map_from_base: Pose2, points: ScanPoints | None) -> bool:
        """Take a scan's pose, and its beams if it was entered; whether a new place has begun."""
        if self._last is not None:
            step = self._last.inverse() @ map_from_base
            self.driven_m += math.hypot(step.x_m, step.y_m) + 0.3 * abs(step.theta_rad)
        self._last = map_from_base
        begun = self.newest < 0 or (
            points is not None and self.driven_m - self._began_at_m[-1] >= self.place_m
        )
        if begun:
            self._begin(map_from_base)
        relative = self.pose(self.newest).inverse() @ map_from_base
        self._relative.extend((self.newest, relative.x_m, relative.y_m, relative.theta_rad))
        if points is not None:
            said = points.kinds != INVALID
            self.scans.append(
                NodeScan(
                    place=self.newest,
                    place_from_base=relative,
                    origins_m=_compact(points.origins_m[said].astype(np.float32)),
                    ends_m=points.ends_m[said].astype(np.float32),
                    kinds=points.kinds[said],
                )
            )
            self._kept += 1
            if self._kept > MOST_KEPT:
                self._thin()
        return begun

    def _thin(self) -> None:
        """Drop every second scan of the older half: a long drive has seen its places many times."""
        kept = [number for number, scan in enumerate(self.scans) if scan is not None]
        for number in kept[: len(kept) // 2 : 2]:
            self.scans[number] = None
            self._kept -= 1

    def connect(self, first: int, second: int, first_from_second: Pose2, *, loop: bool) -> None:
        """Add an edge: of the loop search, or of the active map's match."""
        std_m, std_rad = (TIE_STD_M, TIE_STD_RAD) if loop else (CHAIN_STD_M, CHAIN_STD_RAD)
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

    def tie(self, near: dict[int, float]) -> None:
        """Tie the place just finished to the nearest old one in the active map.

        Both were matched to the same map, so their relative pose is known as well as any: without the tie a
        later loop could pull them apart.
        """
        place = self.newest - 1
        if place < 1:
            return
        here = self.pose(place)
        old = [p for p in near if p < place and self.way_m(p, place) > 4.0 * self.place_m]
        if not old:
            return
        nearest = min(old, key=lambda p: self.pose(p).distance_m(here))
        if self.pose(nearest).distance_m(here) < TIE_EVERY_M:
            self.connect(nearest, place, self.pose(nearest).inverse() @ here, loop=True)

    def within(self, way_m: float) -> dict[int, float]:
        """Places up to `way_m` from the newest along the graph, with that way [m] (Dijkstra)."""
        if self.newest < 0:
            return {}
        found: dict[int, float] = {}
        queue = [(0.0, self.newest)]
        while queue:
            distance_m, place = heapq.heappop(queue)
            if place in found:
                continue
            found[place] = distance_m
            for other, length_m in self._neighbours[place]:
                if other not in found and distance_m + length_m <= way_m:
                    heapq.heappush(queue, (distance_m + length_m, other))
        return found

    def adopt(self, poses: FloatArray) -> None:
        """Take bent poses of the first places, shape (n, 3); those begun since go along with the last."""
        n = len(poses)
        bend = _pose(poses[-1]) @ self.pose(n - 1).inverse()
        newer = [bend @ self.pose(place) for place in range(n, self.newest + 1)]
        rows = np.array([(p.x_m, p.y_m, p.theta_rad) for p in newer]).reshape(-1, 3)
        self.poses = np.concatenate((poses, rows))
        if self._last is not None:
            place, x_m, y_m, theta_rad = self._relative[-4:]
            self._last = self.pose(int(place)) @ Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)

    def enter(self, cells: HitGrid, start: int, places: set[int] | None, most: int) -> int:
        """Enter up to `most` kept scans from number `start` on, of some places or, with None, of all.

        Returns the number of the first one not looked at.
        """
        entered = 0
        for number in range(start, len(self.scans)):
            scan = self.scans[number]
            if scan is not None and (places is None or scan.place in places):
                if entered == most:
                    return number
                cells.integrate(self.pose(scan.place) @ scan.place_from_base, scan.points())
                entered += 1
        return len(self.scans)

    def path(self) -> FloatArray:
        """x, y, theta at each scan, shape (scans, 3)."""
        rows = np.array(self._relative).reshape(-1, 4)
        at, relative = self.poses[rows[:, 0].astype(np.int64)], rows[:, 1:]
        cos, sin = np.cos(at[:, 2]), np.sin(at[:, 2])
        theta_rad = at[:, 2] + relative[:, 2]
        return np.column_stack(
            (
                at[:, 0] + cos * relative[:, 0] - sin * relative[:, 1],
                at[:, 1] + sin * relative[:, 0] + cos * relative[:, 1],
                np.remainder(theta_rad + math.pi, math.tau) - math.pi,
            )
        )

    def _begin(self, map_from_base: Pose2) -> None:
        row = np.array([[map_from_base.x_m, map_from_base.y_m, map_from_base.theta_rad]])
        self.poses = np.concatenate((self.poses, row))
        self._neighbours.append([])
        self._began_at_m.append(self.driven_m)
        if self.newest > 0:
            before = self.newest - 1
            self.connect(before, self.newest, self.pose(before).inverse() @ map_from_base, loop=False)


def _pose(row: FloatArray) -> Pose2:
    x_m, y_m, theta_rad = (float(value) for value in row)
    return Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)


def _compact(origins_m: NDArray[np.float32]) -> NDArray[np.float32]:
    """One row where all are the same."""
    return origins_m[:1].copy() if (origins_m == origins_m[:1]).all() else origins_m
