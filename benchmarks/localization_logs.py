"""Global localization in a map of one half of a log, with scans of the other half.

Run: python benchmarks/localization_logs.py [LOG ...] [--starts N]

Without logs: Intel and MINES of $THUMPER_DATA (default ../shared/data). The true poses are those of `slam`
on the whole log, and the map is built at them. There are N starts in each half: *inside* if the robot's cell
is free in the map, *outside* if not. As many starts use the map of the next log, where every pose is wrong.
Each runs for 100 scans. A pose is right within 0.5 m and 0.3 rad, lost if the localizer reports it as lost,
and wrong otherwise. A confirmed pose is good enough to resume mapping from it.
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

from benchmarks.figure import figure, require_data

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
SCANS, CHECKED_AFTER = 100, (1, 10, 50, 100)
NEAR_M, NEAR_RAD = 0.5, 0.3
OPTIONS = MappingOptions()


@dataclass(frozen=True, slots=True)
class MappedLog:
    """A log, its true poses of shape (scans, 3), and a map of each half."""

    log: RobotLog
    poses: FloatArray
    halves: tuple[OccupancyGrid, OccupancyGrid]

    @classmethod
    def load(cls, path: Path) -> "MappedLog":
        """Read a log and map it."""
        log = open_log(path)
        mapper = make_mapper(OPTIONS, base_from_laser=log.base_from_laser)
        for record in log.records:
            mapper.update(record.odom_from_base, record.scan, record.twist)
        poses, middle, end = mapper.path(), len(log.records) // 2, len(log.records)
        return cls(
            log, poses, (build_map(log, poses, range(middle)), build_map(log, poses, range(middle, end)))
        )

    def true_pose(self, scan: int) -> Pose2:
        """Return the true pose of a scan."""
        return pose_of(self.poses[scan])


def pose_of(row: FloatArray) -> Pose2:
    """Return the pose of a row x, y, theta."""
    x_m, y_m, theta_rad = (float(part) for part in row)
    return Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)


def build_map(log: RobotLog, poses: FloatArray, scans: range) -> OccupancyGrid:
    """Return the map of these scans."""
    hit_grid = HitGrid(OPTIONS.resolution_m, OPTIONS.reach_m, OPTIONS.occupied_fraction)
    last = Pose2(x_m=math.inf)
    for scan in scans:
        pose, record = pose_of(poses[scan]), log.records[scan]
        turn_rad = abs(math.remainder(pose.theta_rad - last.theta_rad, math.tau))
        if pose.distance_m(last) < OPTIONS.integrate_distance_m and turn_rad < OPTIONS.integrate_angle_rad:
            continue
        points = scan_points(record.scan, record.twist, log.base_from_laser, OPTIONS.usable_range_m)
        hit_grid.insert(pose, points)
        last = pose
    return hit_grid.grid(percent=False)


def localize(log: MappedLog, grid: OccupancyGrid, first: int, *, foreign: bool) -> tuple[list[str], str]:
    """Return the verdict on each scan from `first` on, and the verdict on the first confirmed pose."""
    localizer = Amcl(grid, base_from_laser=log.log.base_from_laser)
    verdicts, confirmed = list[str](), "never"
    for scan in range(first, min(first + SCANS, len(log.log.records))):
        record, true = log.log.records[scan], log.true_pose(scan)
        found = localizer.update(record.odom_from_base, record.scan, record.twist).map_from_base
        turn_rad = abs(math.remainder(found.theta_rad - true.theta_rad, math.tau))
        near = not foreign and found.distance_m(true) < NEAR_M and turn_rad < NEAR_RAD
        verdict = "right" if near else "wrong"
        verdicts.append("lost" if localizer.quality().lost else verdict)
        if localizer.confirmed and confirmed == "never":
            confirmed = verdict
    return verdicts, confirmed


def start_kind(grid: OccupancyGrid, pose: Pose2) -> str:
    """Return whether the pose is inside or outside the free space of the map."""
    row, col = grid.cell_of(pose.x_m, pose.y_m)
    return "inside" if grid.contains(row, col) and grid.cells[row, col] == FREE else "outside"


def main() -> None:
    """Print per kind the numbers of right, lost, wrong and confirmed poses."""
    parser = argparse.ArgumentParser(description="global localization in maps of recorded logs")
    parser.add_argument("logs", nargs="*", type=Path, help="recorded logs, of different buildings")
    parser.add_argument("--starts", type=int, default=8, help="number of starts in each half of each log")
    arguments = parser.parse_args()
    for path in arguments.logs or LOGS:
        require_data(path)
    mapped = [MappedLog.load(path) for path in arguments.logs or LOGS]
    counted: dict[str, dict[int | str, Counter[str]]] = defaultdict(lambda: defaultdict(Counter))
    for number, this in enumerate(mapped):
        other, scans = mapped[(number + 1) % len(mapped)], len(this.log.records)
        for half in (0, 1):
            low, high = ((scans // 2, scans), (0, scans // 2))[half]
            for first in np.linspace(low, max(low, high - SCANS), arguments.starts).astype(int).tolist():
                own, foreign = this.halves[half], other.halves[half]
                tries = [(own, start_kind(own, this.true_pose(first)))]
                if other is not this:
                    tries.append((foreign, "in another building"))
                for grid, kind in tries:
                    verdicts, confirmed = localize(this, grid, first, foreign=grid is foreign)
                    for scan in CHECKED_AFTER:
                        counted[kind][scan][verdicts[min(scan, len(verdicts)) - 1]] += 1
                    counted[kind]["confirmed"][confirmed] += 1
    for kind, table in sorted(counted.items()):
        after = ", ".join(
            f"{scan}: {' / '.join(str(table[scan][key]) for key in ('right', 'lost', 'wrong'))}"
            for scan in CHECKED_AFTER
        )
        figure(f"localization {kind}: right / lost / wrong after scans", after)
        confirmed = " / ".join(str(table["confirmed"][key]) for key in ("right", "never", "wrong"))
        figure(f"localization {kind}: confirmed right / never / wrong", confirmed)


if __name__ == "__main__":
    main()
