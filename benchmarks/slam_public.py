"""SLAM on public logs of other buildings, which do not come with the project: path, CPU time and memory.

Run: python benchmarks/slam_public.py [FOLDER] [--method METHOD ...] [--log NAME ...] [--seed N]

FOLDER (default: slam/public in $THUMPER_DATA or ../shared/data) holds files of two GitHub repositories. Fetch
them yourself; logs that are missing are left out:

- `acschaefer/ple`: data/carmen/NAME-corrected.log.gz, from Radish
- `xiaofeng419/SLAM-2D-LIDAR-SCAN`: DataSet/RawData/fr079.relations, of Kuemmerle et al. 2009

These logs contain corrected poses in place of odometry. So odometry is made from them: 3 % long, 5 % wide,
with drift and noise. The path is compared with the poses after the best rotation and shift. The relations of
Freiburg 079 are compared at their stamps. Each log runs in its own process.
"""

import argparse
import math
import multiprocessing
import os
import resource
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure, has_data

from thumper.common.geometry import FloatArray, Pose2
from thumper.offline.map_log import map_records
from thumper.offline.metrics import relation_errors
from thumper.offline.open_log import open_log
from thumper.offline.robot_log import RobotLog
from thumper.slam.factory import MappingOptions, Method

LOGS = (
    "freiburg-079",
    "aces",
    "csail",
    "infinite-corridor",
    "freiburg-101",
    "belgioioso",
    "edmonton",
    "fhw",
    "orebro",
    "seattle",
    "acapulco",
    "freiburg-campus",
)
RELATIONS = "fr079.relations"
RELATIONS_LATER_S = 1211.44  # their stamps, than the log's: the offset at which both move alike
# Hess et al., "Real-time loop closure in 2D LIDAR SLAM", ICRA 2016, table IV, and those it compares with.
PEERS_079 = "Cartographer 0.045 ± 0.035; Graph Mapping 0.056 ± 0.042; RBPF (50) 0.061 ± 0.044"
SOURCE = "published; same relations"


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """A mapped log, small: what the parent holds counts as memory of the next child, too."""

    path: FloatArray  # shape (scans, 3)
    online: FloatArray
    cpu_ms: FloatArray  # of each scan, shape (scans,)
    lost: int
    poses: FloatArray  # those of the log, shape (scans, 3)
    stamps_s: FloatArray  # shape (scans,)
    peak_MB: float


def rows(poses: list[Pose2]) -> FloatArray:
    """Return poses as rows x, y, theta."""
    return np.array([(pose.x_m, pose.y_m, pose.theta_rad) for pose in poses])


def with_wheel_errors(log: RobotLog, seed: int) -> RobotLog:
    """Return the log with odometry that errs like badly calibrated wheels."""
    rng, odometry, last, records = np.random.default_rng(seed), Pose2(), log.records[0].odom_from_base, []
    for record in log.records:
        step, last = last.inverse() @ record.odom_from_base, record.odom_from_base
        distance_m = math.hypot(step.x_m, step.y_m)
        noise = 0.01 * math.sqrt(distance_m) * rng.standard_normal(2)
        turn_rad = 1.05 * step.theta_rad + 0.004 * distance_m + noise[1]
        odometry = odometry @ Pose2(x_m=1.03 * step.x_m + noise[0], y_m=step.y_m, theta_rad=turn_rad)
        records.append(replace(record, odom_from_base=odometry))
    return replace(log, records=tuple(records))


def without_odometry(log: RobotLog) -> RobotLog:
    """Return the log as if it contained scans alone."""
    records = tuple(replace(record, odom_from_base=Pose2()) for record in log.records)
    return replace(log, records=records, has_odometry=False)


def run(path: Path, method: Method, seed: int, *, odometry: bool) -> Result:
    """Map a log; `seed` is that of its odometry."""
    log = open_log(path)
    mapped = map_records(
        with_wheel_errors(log, seed) if odometry else without_odometry(log), MappingOptions(method=method)
    )
    return Result(
        path=mapped.poses,
        online=mapped.online,
        cpu_ms=mapped.cpu_ms,
        lost=mapped.lost,
        poses=rows([record.odom_from_base for record in log.records]),
        stamps_s=np.array([record.time_s for record in log.records]),
        peak_MB=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    )


def rms_m(path: FloatArray, true: FloatArray) -> float:
    """Return the position error after the best rotation and shift (Horn's method in the plane)."""
    ours, theirs = (p[:, 0] + 1j * p[:, 1] - np.mean(p[:, 0] + 1j * p[:, 1]) for p in (path, true))
    turn = np.vdot(ours, theirs)
    return float(np.sqrt(np.mean(np.abs(ours * turn / abs(turn) - theirs) ** 2)))


def at_stamps(result: Result, relations: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the path at the relations' stamps, and the relations by number of these poses."""
    stamps_s, numbers = np.unique(relations[:, :2], return_inverse=True)
    path, times_s = result.path, stamps_s - RELATIONS_LATER_S
    columns = (path[:, 0], path[:, 1], np.unwrap(path[:, 2]))
    poses = np.column_stack([np.interp(times_s, result.stamps_s, column) for column in columns])
    return poses, np.column_stack((numbers.reshape(-1, 2), relations[:, [2, 3, 7]]))


def report(name: str, method: Method, result: Result, folder: Path, *, odometry: bool) -> None:
    """Record the figures of one log."""
    what = f"{method}, {name}{'' if odometry else ' without odometry'}"
    path_m, online_m = rms_m(result.path, result.poses), rms_m(result.online, result.poses)
    figure(f"{what}: position rms, path / online", f"{path_m:.3f} / {online_m:.3f}", "m")
    cost = f"{result.cpu_ms.mean():.2f} / {np.percentile(result.cpu_ms, 99):.1f}"
    figure(f"{what}: CPU per scan, mean / 99 %", cost, "ms")
    figure(f"{what}: scans lost", f"{result.lost} of {len(result.cpu_ms)}")
    figure(f"{what}: peak memory", f"{result.peak_MB:.0f}", "MB")
    if name == "freiburg-079" and has_data(folder / RELATIONS):
        errors = relation_errors(*at_stamps(result, np.loadtxt(folder / RELATIONS)))
        metres, degrees = errors.translation_m, np.degrees(errors.rotation_rad)
        ours = f"{metres.mean():.3f} ± {metres.std():.3f}"
        figure(f"{what}: error of relations", ours, "m", peers=PEERS_079, source=SOURCE)
        figure(
            f"{what}: error of relations",
            f"{degrees.mean():.2f} ± {degrees.std():.2f}",
            "deg",
            peers="Cartographer 0.54 ± 0.72",
            source=SOURCE,
        )


def main() -> None:
    """Print the figures of each log and method."""
    parser = argparse.ArgumentParser(description="SLAM on public logs")
    data = Path(os.environ.get("THUMPER_DATA", Path(__file__).parents[2] / "shared" / "data"))
    folder_help = "folder with the fetched files"
    parser.add_argument("folder", nargs="?", type=Path, default=data / "slam" / "public", help=folder_help)
    methods = ("slam", "scan_match", "rbpf")
    parser.add_argument("--method", nargs="+", default=["slam", "scan_match"], choices=methods)
    parser.add_argument("--log", nargs="+", default=list(LOGS), choices=LOGS)
    parser.add_argument("--seed", type=int, default=1, help="of the errors of the odometry")
    arguments = parser.parse_args()
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=spawn, max_tasks_per_child=1) as pool:
        for name in arguments.log:
            path = arguments.folder / f"{name}-corrected.log.gz"
            for method in arguments.method if has_data(path) else ():
                for odometry in (True, False) if name == "freiburg-079" else (True,):
                    result = pool.submit(run, path, method, arguments.seed, odometry=odometry).result()
                    report(name, method, result, arguments.folder, odometry=odometry)


if __name__ == "__main__":
    main()
