"""Searches in a map of half of a log, from scans of its other half: found, in doubt, or wrongly believed.

Run: python benchmarks/localization_logs.py [LOG ...] [--starts N]
Without logs: Intel and MINES of $THUMPER_DATA (default ../shared/data). True poses are those of `graph` on
the whole log, and the map is drawn at them. N starts in each half: *inside* where the map knows the robot's
cell, *outside* where it does not; and as many in the map of the next log, where nothing may be believed. Each
goes on for 100 scans. Wrong is 0.5 m or 0.3 rad off and in no doubt; proven is what a session is mapped on
from.
"""

import argparse
import math
import os
import sys
from collections import Counter, defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure, need

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.deskew import scan_points
from thumper.maps.occupancy_grid import FREE, OccupancyGrid
from thumper.offline.open_log import open_log
from thumper.offline.robot_log import RobotLog
from thumper.slam.factory import MappingOptions, make_mapper
from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.localization.amcl import Amcl

DATA = Path(os.environ.get("THUMPER_DATA", Path(__file__).parents[2] / "shared" / "data")) / "slam"
LOGS = (DATA / "intel-lab.clf.gz", DATA / "mines-exp1.dat.gz")
SCANS, ASKED = 100, (1, 10, 50, 100)
NEAR_M, NEAR_RAD = 0.5, 0.3
OPTIONS = MappingOptions(method="graph")


@dataclass(frozen=True, slots=True)
class Way:
    """A log, its true poses of shape (scans, 3), and a map of each half."""

    log: RobotLog
    poses: FloatArray
    halves: tuple[OccupancyGrid, OccupancyGrid]

    @classmethod
    def of(cls, path: Path) -> "Way":
        """Read and map a log."""
        log = open_log(path)
        mapper = make_mapper(OPTIONS, base_from_laser=log.base_from_laser)
        for record in log.records:
            mapper.update(record.odom_from_base, record.scan, record.twist)
        poses, middle, end = mapper.path(), len(log.records) // 2, len(log.records)
        return cls(log, poses, (drawn(log, poses, range(middle)), drawn(log, poses, range(middle, end))))

    def true(self, scan: int) -> Pose2:
        """Where it was."""
        return pose_of(self.poses[scan])


def pose_of(row: FloatArray) -> Pose2:
    """From x, y, theta."""
    x_m, y_m, theta_rad = (float(part) for part in row)
    return Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)


def drawn(log: RobotLog, poses: FloatArray, scans: range) -> OccupancyGrid:
    """The map of these scans."""
    cells = HitGrid(OPTIONS.resolution_m, OPTIONS.reach_m, OPTIONS.occupied_fraction)
    last = Pose2(x_m=math.inf)
    for scan in scans:
        pose, record = pose_of(poses[scan]), log.records[scan]
        turn_rad = abs(math.remainder(pose.theta_rad - last.theta_rad, math.tau))
        if pose.distance_m(last) < OPTIONS.integrate_distance_m and turn_rad < OPTIONS.integrate_angle_rad:
            continue
        points = scan_points(record.scan, record.twist, log.base_from_laser, OPTIONS.usable_range_m)
        cells.integrate(pose, points)
        last = pose
    return cells.grid(percent=False)


def searched(way: Way, grid: OccupancyGrid, first: int, *, foreign: bool) -> tuple[list[str], str]:
    """What is believed at each scan from the first on, and what is proven in the end."""
    localiser, judged, proven = Amcl(grid, base_from_laser=way.log.base_from_laser), [], "never"
    for scan in range(first, min(first + SCANS, len(way.log.records))):
        record, true = way.log.records[scan], way.true(scan)
        found = localiser.update(record.odom_from_base, record.scan, record.twist).map_from_base
        turn_rad = abs(math.remainder(found.theta_rad - true.theta_rad, math.tau))
        near = not foreign and found.distance_m(true) < NEAR_M and turn_rad < NEAR_RAD
        believed = "right" if near else "wrong"
        judged.append("doubt" if localiser.quality().lost else believed)
        if localiser.confirmed and proven == "never":
            proven = believed
    return judged, proven


def where(grid: OccupancyGrid, pose: Pose2) -> str:
    """Whether the map knows the place."""
    row, col = grid.cell_of(pose.x_m, pose.y_m)
    return "inside" if grid.contains(row, col) and grid.cells[row, col] == FREE else "outside"


def main() -> None:
    """Print, of each kind, how many are right, in doubt and wrong after so many scans, and what is proven."""
    parser = argparse.ArgumentParser(description="searches in maps of recorded logs")
    parser.add_argument("logs", nargs="*", type=Path, help="recorded logs, of different buildings")
    parser.add_argument("--starts", type=int, default=8, help="in each half of each log")
    arguments = parser.parse_args()
    for path in arguments.logs or LOGS:
        need(path)
    ways = [Way.of(path) for path in arguments.logs or LOGS]
    counted: dict[str, dict[int | str, Counter[str]]] = defaultdict(lambda: defaultdict(Counter))
    for number, way in enumerate(ways):
        other, scans = ways[(number + 1) % len(ways)], len(way.log.records)
        for half in (0, 1):
            low, high = ((scans // 2, scans), (0, scans // 2))[half]
            for first in np.linspace(low, max(low, high - SCANS), arguments.starts).astype(int).tolist():
                own, foreign = way.halves[half], other.halves[half]
                tries = [(own, where(own, way.true(first)))]
                if other is not way:
                    tries.append((foreign, "in another building"))
                for grid, kind in tries:
                    judged, proven = searched(way, grid, first, foreign=grid is foreign)
                    for asked in ASKED:
                        counted[kind][asked][judged[min(asked, len(judged)) - 1]] += 1
                    counted[kind]["proven"][proven] += 1
    for kind, table in sorted(counted.items()):
        after = ", ".join(
            f"{asked}: {' / '.join(str(table[asked][key]) for key in ('right', 'doubt', 'wrong'))}"
            for asked in ASKED
        )
        figure(f"search {kind}: right / doubt / wrong after scans", after)
        told = " / ".join(str(table["proven"][key]) for key in ("right", "never", "wrong"))
        figure(f"search {kind}: proven right / never / wrong", told)


if __name__ == "__main__":
    main()
