"""Run gmapping, LaMa and our mappers in turn on the same recorded logs: `make bench-peers`.

Run: python -m benchmarks.peers.mappers [--scans N]

Each scan is given to each mapper, one after the other. Times are CPU milliseconds of this thread, with all
that a call of the mapper does. The mean is over all scans, also those that a gate leaves out.
A ratio is that mean over the mean of LaMa's single hypothesis, which matches every scan, as ours do. Below
1 it is faster. Behind it are the least and the greatest of five parts of the log. The error is of the pose
that was reported at the time of each scan.
"""

import argparse
import ctypes
import math
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from benchmarks.figure import figure, has_data
from benchmarks.navigation import DATA
from benchmarks.peers.sources import build_gmapping, build_lama
from numpy.typing import NDArray

from thumper.common.geometry import Pose2
from thumper.offline.metrics import load_relations, relation_errors
from thumper.offline.open_log import open_log
from thumper.offline.robot_log import LogRecord, RobotLog
from thumper.slam.factory import MappingOptions, Method, make_mapper

Update = Callable[[LogRecord], Pose2]
REFERENCE = "LaMa, single hypothesis"
GMAPPING_RANGE_M = 80.0  # of a lidar whose log does not say it
PARTICLES = 30


class Peer:
    """What all peers share: the pose between the scans that they match comes from odometry."""

    def __init__(self, log: RobotLog) -> None:
        laser = log.base_from_laser
        if laser.y_m or laser.theta_rad:
            raise ValueError("the peers' drivers take a lidar that looks ahead, on the robot's axis")
        self._ahead_m = laser.x_m
        self._pose = self._odom = Pose2()

    def _reported(self, record: LogRecord, pose: ctypes.Array[ctypes.c_double], *, is_matched: bool) -> Pose2:
        if is_matched:
            self._pose = Pose2(x_m=pose[0], y_m=pose[1], theta_rad=pose[2])
            self._odom = record.odom_from_base
        return self._pose @ self._odom.inverse() @ record.odom_from_base


class Lama(Peer):
    """LaMa: a single hypothesis without a gate, or particles with a gate [m]; the library's own is 0.5 m."""

    def __init__(self, library: Path, log: RobotLog, *, particles: int, gate: float) -> None:
        super().__init__(log)
        self._lib = ctypes.CDLL(str(library))
        self._lib.lama_new.restype = ctypes.c_void_p
        self._mapper = ctypes.c_void_p(self._lib.lama_new(particles, ctypes.c_double(gate)))

    def update(self, record: LogRecord) -> Pose2:
        """Add a scan; return the pose."""
        scan, pose = record.scan, (ctypes.c_double * 3)()
        is_hit = np.isfinite(scan.ranges_m) & (scan.ranges_m > scan.range_min_m)
        ranges_m, angles_rad = scan.ranges_m[is_hit], scan.angles_rad()[is_hit]
        points_m = np.column_stack(
            (self._ahead_m + ranges_m * np.cos(angles_rad), ranges_m * np.sin(angles_rad))
        )
        is_matched = self._lib.lama_update(
            self._mapper,
            _doubles(points_m),
            len(points_m),
            ctypes.c_double(self._ahead_m),
            _pose(record.odom_from_base),
            ctypes.c_double(record.time_s),
            pose,
        )
        return self._reported(record, pose, is_matched=bool(is_matched))


class Gmapping(Peer):
    """gmapping with the options of slam_gmapping: it matches after 1 m or 0.5 rad."""

    def __init__(self, library: Path, log: RobotLog) -> None:
        super().__init__(log)
        self._lib = ctypes.CDLL(str(library))
        self._lib.gmapping_new.restype = ctypes.c_void_p
        first = log.records[0]
        range_m = first.scan.range_max_m
        self._range_m = range_m if math.isfinite(range_m) else GMAPPING_RANGE_M
        angles_rad = first.scan.angles_rad()
        self._mapper = ctypes.c_void_p(
            self._lib.gmapping_new(
                PARTICLES,
                _doubles(angles_rad),
                len(angles_rad),
                ctypes.c_double(self._ahead_m),
                ctypes.c_double(self._range_m),
                _pose(first.odom_from_base),
            )
        )

    def update(self, record: LogRecord) -> Pose2:
        """Add a scan; return the pose."""
        pose = (ctypes.c_double * 3)()
        ranges_m = np.where(np.isfinite(record.scan.ranges_m), record.scan.ranges_m, self._range_m)
        is_matched = self._lib.gmapping_update(
            self._mapper,
            _doubles(ranges_m),
            _pose(record.odom_from_base),
            ctypes.c_double(record.time_s),
            pose,
        )
        return self._reported(record, pose, is_matched=bool(is_matched))


def our_mapper(log: RobotLog, method: Method) -> Update:
    """Return one of our mappers, with its kernels compiled."""
    mapper = make_mapper(MappingOptions(method=method), base_from_laser=log.base_from_laser)
    mapper.warm_up()
    return lambda record: mapper.update(record.odom_from_base, record.scan, record.twist).map_from_base


def measure(log: RobotLog, updates: dict[str, Update]) -> dict[str, tuple[NDArray[np.float64], list[Pose2]]]:
    """Return the times of each mapper, shape (scans,) [ms], and the poses that it reported."""
    results: dict[str, tuple[list[float], list[Pose2]]] = {name: ([], []) for name in updates}
    for record in log.records:
        for name, update in updates.items():
            begun_s = time.thread_time()
            pose = update(record)
            results[name][0].append(1e3 * (time.thread_time() - begun_s))
            results[name][1].append(pose)
    return {name: (np.array(times), poses) for name, (times, poses) in results.items()}


def report(name: str, log: RobotLog, gmapping: Path, lama: Path, relations_path: Path | None) -> None:
    """Measure and print a row for each mapper."""
    updates: dict[str, Update] = {
        REFERENCE: Lama(lama, log, particles=0, gate=0.0).update,
        "LaMa, 30 particles, gate 0.2": Lama(lama, log, particles=PARTICLES, gate=0.2).update,
        "gmapping, 30 particles": Gmapping(gmapping, log).update,
        "slam": our_mapper(log, "slam"),
        "scan_match": our_mapper(log, "scan_match"),
        "rbpf, 30 particles": our_mapper(log, "rbpf"),
    }
    results = measure(log, updates)
    for who, (times, poses) in results.items():
        reference = results[REFERENCE][0]
        ratios = [part.mean() / other.mean() for part, other in _parts(times, reference)]
        row = [
            f"mean {times.mean():.2f}, 99 % {np.percentile(times, 99):.1f} ms",
            f"mean x {times.mean() / reference.mean():.2f} ({min(ratios):.2f} to {max(ratios):.2f})",
        ]
        if relations_path is not None:
            relations = load_relations(relations_path)
            table = np.array([(pose.x_m, pose.y_m, pose.theta_rad) for pose in poses])
            errors = relation_errors(table, relations[relations[:, :2].max(axis=1) < len(table)])
            row.append(f"online error {errors.translation_m.mean():.3f} m")
        figure(f"{name}: {who}", "; ".join(row))


def main() -> int:
    """Build the peers, run them beside ours and print the ratios."""
    parser = argparse.ArgumentParser(description="our mappers beside gmapping and LaMa, in turn")
    parser.add_argument("--scans", type=int, help="only the first N of each log")
    scans = parser.parse_args().scans
    try:
        gmapping, lama = build_gmapping(), build_lama()
    except (subprocess.CalledProcessError, FileNotFoundError) as error:
        print(f"gmapping or LaMa cannot be fetched or built: {error}", file=sys.stderr)
        return 1
    folder = DATA.parent / "slam"
    for file, relations in (
        ("mines-exp1.dat.gz", None),
        ("intel-lab.clf.gz", "intel-lab.relations-by-scan.gz"),
    ):
        if has_data(folder / file):
            log = open_log(folder / file)
            cut = RobotLog(
                format_name=log.format_name,
                base_from_laser=log.base_from_laser,
                records=log.records[:scans],
            )
            name = file.split(".", maxsplit=1)[0]
            report(name, cut, gmapping, lama, folder / relations if relations else None)
    return 0


def _parts(
    times: NDArray[np.float64], reference: NDArray[np.float64]
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return both in five parts of the log: the spread of the ratios."""
    return list(zip(np.array_split(times, 5), np.array_split(reference, 5), strict=True))


def _doubles(values: NDArray[np.float64]) -> "ctypes.Array[ctypes.c_double]":
    return np.ctypeslib.as_ctypes(np.ascontiguousarray(values).ravel())


def _pose(pose: Pose2) -> "ctypes.Array[ctypes.c_double]":
    return (ctypes.c_double * 3)(pose.x_m, pose.y_m, pose.theta_rad)


if __name__ == "__main__":
    sys.exit(main())
