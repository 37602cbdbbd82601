"""Carry the robot away while it maps recorded logs: what the mapper notices, and false alarms.

Run: python benchmarks/slam_kidnapping.py [LOG ...] [--cuts N]

Without logs: MINES exp1 and exp2 and Intel of $THUMPER_DATA (default ../shared/data). At N scans of each log
the robot is carried to where it was at another scan, and drives on from there: to a place that it has mapped,
and to one that it has not. The odometry goes on as if it had been stationary. A pose is wrong if it is
0.5 m or 0.3 rad off the path of the whole log, in the frame of that path. It is trusted if it is not lost.
The log as it is, and with every second, third, fifth and tenth scan only, gives the false alarms.
"""

import argparse
import copy
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure, require_data
from benchmarks.localization_logs import DATA, pose_of

from thumper.common.geometry import FloatArray, Pose2, wrap_angle
from thumper.offline.map_log import map_records
from thumper.offline.open_log import open_log
from thumper.offline.robot_log import RobotLog
from thumper.slam.factory import MappingOptions, make_mapper
from thumper.slam.grid.grid_mapper import GridMapper

LOGS = (DATA / "mines-exp1.dat.gz", DATA / "mines-exp2.dat.gz", DATA / "intel-lab.clf.gz")
OPTIONS = MappingOptions(method="scan_match")
SCANS, NOTICED_AFTER = 100, 10  # scans after the robot was carried away
AWAY_M, APART_SCANS = 1.5, 100
NEAR_M, NEAR_RAD = 0.5, 0.3
EVERY = (1, 2, 3, 5, 10)


@dataclass(slots=True)
class Count:
    """What happened after the robot was carried away."""

    cuts: int = 0
    noticed: int = 0  # lost within `NOTICED_AFTER` scans
    spoiled: int = 0  # times that scans entered the map at a wrong pose
    inserted: int = 0  # these scans
    trusted: int = 0  # scans with a wrong pose that is not lost, after the first `NOTICED_AFTER`
    scans: int = 0


def is_near(first: Pose2, second: Pose2, distance_m: float, angle_rad: float) -> bool:
    """Return whether two poses are this close."""
    turn_rad = abs(wrap_angle(first.theta_rad - second.theta_rad))
    return first.distance_m(second) < distance_m and turn_rad < angle_rad


def carry_away(
    mapper: GridMapper, log: RobotLog, path: FloatArray, cut: int, there: int, count: Count
) -> None:
    """Continue before scan `cut` with the scans from `there` on."""
    before = log.records[cut - 1].odom_from_base
    shift = before @ log.records[there].odom_from_base.inverse()
    noticed, inserted = False, 0
    end = min(there + SCANS, len(log.records))
    for number in range(there, end):
        record = log.records[number]
        update = mapper.update(shift @ record.odom_from_base, record.scan, record.twist)
        lost = bool(mapper.quality().lost)
        noticed |= lost and number < there + NOTICED_AFTER
        wrong = not is_near(update.map_from_base, pose_of(path[number]), NEAR_M, NEAR_RAD)
        inserted += update.integrated and wrong
        if number >= there + NOTICED_AFTER:
            count.trusted += wrong and not lost
            count.scans += 1
    count.cuts += 1
    count.noticed += noticed
    count.spoiled += inserted > 0
    count.inserted += inserted


def kidnap(log: RobotLog, cuts: int) -> dict[str, Count]:
    """Carry the robot away at `cuts` scans."""
    mapper = make_mapper(OPTIONS, base_from_laser=log.base_from_laser)
    assert isinstance(mapper, GridMapper)
    path = map_records(log, OPTIONS).poses
    rng, scans = np.random.default_rng(1), len(log.records)
    counts = {"into the map": Count(), "out of the map": Count()}
    at = set(np.linspace(scans // 5, scans - scans // 5, cuts).astype(int).tolist())
    for number, record in enumerate(log.records):
        if number in at:
            away = np.hypot(*(path[:, :2] - path[number, :2]).T) > AWAY_M
            numbers = np.arange(scans)
            mapped = away & (numbers < number - APART_SCANS)
            later = away & (numbers > number + APART_SCANS) & (numbers < scans - SCANS)
            for name, candidates in zip(
                counts, (np.flatnonzero(mapped), _new(path, number, later)), strict=True
            ):
                if candidates.size:
                    there = int(rng.choice(candidates))
                    carry_away(copy.deepcopy(mapper), log, path, number, there, counts[name])
        mapper.update(record.odom_from_base, record.scan, record.twist)
    return counts


def _new(path: FloatArray, number: int, later: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return some of the later scans that are far from all scans before `number`."""
    found = np.flatnonzero(later)
    found = found[:: max(1, len(found) // 200)]
    nearest_m = [np.hypot(*(path[:number, :2] - path[k, :2]).T).min() for k in found]
    return found[np.array(nearest_m) > AWAY_M] if found.size else found


def main() -> None:
    """Print the figures of each log."""
    parser = argparse.ArgumentParser(description="kidnapped while mapping recorded logs")
    parser.add_argument("logs", nargs="*", type=Path, help="recorded logs")
    parser.add_argument("--cuts", type=int, default=24, help="times that the robot is carried away in a log")
    arguments = parser.parse_args()
    for path in arguments.logs or LOGS:
        require_data(path)
        log, name = open_log(path), path.name.split(".")[0]
        for where, count in kidnap(log, arguments.cuts).items():
            what = f"{name}, carried {where}"
            figure(f"{what}: noticed within {NOTICED_AFTER} scans", f"{count.noticed} of {count.cuts}")
            figure(f"{what}: times the map was spoiled", f"{count.spoiled} ({count.inserted} scans)")
            figure(f"{what}: later scans with a wrong pose trusted", f"{count.trusted} of {count.scans}")
        lost = [map_records(replace(log, records=log.records[::every]), OPTIONS).lost for every in EVERY]
        figure(f"{name}: scans lost, every 1st / 2nd / 3rd / 5th / 10th", " / ".join(map(str, lost)), aim="0")


if __name__ == "__main__":
    main()
