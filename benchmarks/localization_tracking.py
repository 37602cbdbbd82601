"""Track a right start pose: in a room that has changed since, and in the map of a log's first half.

Run: python benchmarks/localization_tracking.py [LOG ...]

The start pose is right. Without logs: MINES exp2 in the map of exp1, where the furniture was moved between
the drives, and the second halves of Intel, MINES exp1 and exp2 in the maps of the first, from $THUMPER_DATA
(default ../shared/data). A scan counts as inside if the robot's cell is free in the map. After a way outside
the robot must find itself again.

The true poses are those of `slam` on the whole log. Those of exp2 are joined to exp1's map by the median of
all tracked poses, so the figures of that drive hold only if most of it is tracked right.
"""

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure, require_data
from benchmarks.localization_logs import DATA, MappedLog, build_map, pose_of, start_kind

from thumper.common.geometry import Pose2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.slam.localization.amcl import Amcl

HALVES = (DATA / "intel-lab.clf.gz", DATA / "mines-exp1.dat.gz", DATA / "mines-exp2.dat.gz")
CHANGED = (DATA / "mines-exp1.dat.gz", DATA / "mines-exp2.dat.gz")  # before and after
WRONG_M = 0.5


def tracked(
    log: MappedLog, grid: OccupancyGrid, scans: range, start: Pose2 | None
) -> list[tuple[Pose2, bool]]:
    """Return the pose at each scan, and whether it is trusted; without a start the whole map is searched."""
    localizer = Amcl(grid, base_from_laser=log.log.base_from_laser, map_from_base=start)
    found = []
    for record in log.log.records[scans.start : scans.stop]:
        pose = localizer.update(record.odom_from_base, record.scan, record.twist).map_from_base
        found.append((pose, not localizer.quality().lost))
    return found


def median_shift(log: MappedLog, scans: range, found: Sequence[tuple[Pose2, bool]]) -> Pose2:
    """Return the map's frame seen from that of the log's true poses: the median over the trusted scans."""
    shifts = [
        pose @ log.true_pose(scan).inverse()
        for scan, (pose, trusted) in zip(scans, found, strict=True)
        if trusted
    ]
    sin, cos = (np.median([f(shift.theta_rad) for shift in shifts]) for f in (math.sin, math.cos))
    theta_rad = math.atan2(sin, cos)
    # The middle of the path has the least lever arm.
    middle = pose_of(np.median(log.poses, axis=0))
    x_m, y_m = np.median([(s @ middle).apply(np.zeros((1, 2)))[0] for s in shifts], axis=0)
    turned = Pose2(theta_rad=theta_rad) @ middle
    return Pose2(x_m=float(x_m) - turned.x_m, y_m=float(y_m) - turned.y_m, theta_rad=theta_rad)


def report(
    name: str,
    grid: OccupancyGrid,
    true: Callable[[int], Pose2],
    scans: range,
    found: list[tuple[Pose2, bool]],
) -> None:
    """Record how many scans inside the map are lost, and how far off the poses are."""
    inside = [
        (pose.distance_m(true(scan)), trusted)
        for scan, (pose, trusted) in zip(scans, found, strict=True)
        if start_kind(grid, true(scan)) == "inside"
    ]
    lost = sum(not trusted for _, trusted in inside)
    wrong = sum(
        trusted and pose.distance_m(true(scan)) > WRONG_M
        for scan, (pose, trusted) in zip(scans, found, strict=True)
    )
    worst_m = max((error_m for error_m, _ in inside), default=math.nan)
    share = f"{lost} of {len(inside)} ({100.0 * lost / max(1, len(inside)):.1f} %)"
    figure(f"{name}: scans lost inside the map", share)
    figure(f"{name}: worst pose inside the map", f"{worst_m:.2f}", "m", aim="<= 0.5")
    figure(f"{name}: scans trusted more than {WRONG_M} m off", str(wrong), aim="0")


def second_half(log: MappedLog, name: str) -> None:
    """Track the second half of a log in the map of its first."""
    scans = range(len(log.log.records) // 2, len(log.log.records))
    found = tracked(log, log.halves[0], scans, log.true_pose(scans.start))
    report(f"second half of {name}", log.halves[0], log.true_pose, scans, found)


def changed_room(before: MappedLog, after: MappedLog, name: str) -> None:
    """Track a drive in the map of an earlier one."""
    grid = build_map(before.log, before.poses, range(len(before.log.records)))
    scans = range(len(after.log.records))
    searched = median_shift(after, scans, tracked(after, grid, scans, None))
    found = tracked(after, grid, scans, searched @ after.true_pose(0))
    shift = median_shift(after, scans, found)
    report(name, grid, lambda scan: shift @ after.true_pose(scan), scans, found)


def main() -> None:
    """Print the figures of each drive."""
    parser = argparse.ArgumentParser(description="tracking a right pose in maps of recorded logs")
    parser.add_argument("logs", nargs="*", type=Path, help="logs whose second half is tracked in the first")
    arguments = parser.parse_args()
    for path in (*HALVES, *arguments.logs):
        require_data(path)
    mapped = {path: MappedLog.load(path) for path in arguments.logs or HALVES}
    for path, log in mapped.items():
        second_half(log, path.name.split(".")[0])
    if not arguments.logs:
        before, after = (mapped[path] for path in CHANGED)
        changed_room(before, after, "mines-exp2 in the map of exp1")


if __name__ == "__main__":
    main()
