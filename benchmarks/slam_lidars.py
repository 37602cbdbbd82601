"""Map synthetic logs of many lidars: 4, 30 and 80 m, 180 to 360 degrees, each mapper at its defaults.

Run: python benchmarks/slam_lidars.py [--seeds N] [--method slam|scan_match|rbpf ...] [--range M ...]

Each drive is written as a CARMEN log, read back and mapped as `thumper map-log` does, in a place that fits
the lidar. The odometry error is that of experiment 1 of the thesis: it uses a track of 0.245 m while the
robot turns as with 0.3675 m, so that every rotation is measured 50 % too large. The odometry also has noise
and a drift. Errors are those of relative poses (Kuemmerle et al. 2009): of scans 1 and 10 m apart along the
path, and of scans where the robot returned to a place.
"""

import argparse
import itertools
import math
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure
from benchmarks.slam_truth import polyline, rooms

from thumper.common.geometry import FloatArray, Pose2
from thumper.offline.map_log import map_records
from thumper.offline.metrics import relation_errors
from thumper.offline.open_log import open_log
from thumper.slam.factory import MappingOptions, Method
from thumper.slam.particle_filter.options import RbpfOptions
from thumper_hil.world.world import World

TURN_SCALE = 0.3675 / 0.245  # effective over geometric track
REVISIT_M = 1.5  # scans closer than this, with a long path between them, revisit a place
FAILED_M = 0.5  # an error of this size in a relative pose doubles a wall


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """Ground truth of one drive and the content of its log."""

    poses: FloatArray  # x, y, theta, shape (n, 3)
    odometry: list[Pose2]
    ranges_m: list[FloatArray]
    angles_rad: FloatArray
    range_m: float


def hall(rng: np.random.Generator) -> tuple[World, list[Pose2]]:
    """Return a hall of 40 x 28 m with machines and pillars, and a path around, across and around again."""
    rows = box(0, 0, 40, 28)
    for x, y in itertools.product((8.0, 18.0, 28.0), (7.0, 17.0)):
        rows += box(x, y, x + rng.uniform(2.0, 5.0), y + rng.uniform(1.5, 4.0))
    circles = np.column_stack(
        (rng.uniform(1, 39, 14), rng.choice([0.5, 27.5], 14), rng.uniform(0.1, 0.3, 14))
    )
    ring = [(3.0, 3.5), (36.5, 3.5), (36.5, 24.5), (3.0, 24.5)]
    path = [*ring, (3.0, 14.0), (36.5, 14.0), (36.5, 3.5), *ring[:2]]
    return World(segments_m=np.array(rows), circles_m=circles), polyline(path, step_m=0.15)


def yard(rng: np.random.Generator) -> tuple[World, list[Pose2]]:
    """Return a fenced yard of 150 x 90 m with houses and trees, and a path around two blocks and back."""
    rows = box(0, 0, 150, 90)
    for x, y in itertools.product((18.0, 62.0, 106.0), (16.0, 52.0)):
        rows += box(x, y, x + rng.uniform(14.0, 26.0), y + rng.uniform(10.0, 20.0))
    x_m, y_m = rng.uniform(5.0, 145.0, 40), rng.choice([6.0, 43.5, 84.0], 40)
    circles = np.column_stack((x_m, y_m, rng.uniform(0.1, 0.4, 40)))
    round_one = [(10.0, 10.0), (140.0, 10.0), (140.0, 80.0), (54.0, 80.0), (54.0, 10.0), (10.0, 10.0)]
    path = [*round_one, (10.0, 80.0), (54.0, 80.0), (54.0, 47.0), (96.0, 47.0)]
    return World(segments_m=np.array(rows), circles_m=circles), polyline(path, step_m=0.3)


def box(x0: float, y0: float, x1: float, y1: float) -> list[tuple[float, float, float, float]]:
    """Return four walls."""
    return [(x0, y0, x1, y0), (x1, y0, x1, y1), (x1, y1, x0, y1), (x0, y1, x0, y0)]


Build = Callable[[np.random.Generator], tuple[World, list[Pose2]]]
PLACES: dict[float, tuple[str, Build]] = {
    4.0: ("six rooms, 18 x 12 m", rooms),
    30.0: ("hall, 40 x 28 m", hall),
    80.0: ("yard, 150 x 90 m", yard),
}
BEAMS = {180: 181, 270: 361, 360: 480}


def drive(range_m: float, fov_deg: int, seed: int) -> Drive:
    """Drive through the place and take a scan at each step."""
    rng = np.random.default_rng(seed)
    world, poses = PLACES[range_m][1](rng)
    n = BEAMS[fov_deg]
    step_deg = fov_deg / (n if fov_deg == 360 else n - 1)
    angles_rad = np.radians(-0.5 * fov_deg + step_deg * np.arange(n))
    odometry, measured, ranges = Pose2(), [], []
    for before, pose in zip([poses[0], *poses[:-1]], poses, strict=True):
        step = before.inverse() @ pose
        step_m = math.hypot(step.x_m, step.y_m)
        noise = rng.standard_normal(2) * math.sqrt(step_m)
        odometry = odometry @ Pose2(
            x_m=1.01 * step.x_m + 0.01 * noise[0],
            y_m=step.y_m,
            theta_rad=TURN_SCALE * step.theta_rad + 0.004 * step_m + 0.01 * noise[1],
        )
        measured.append(odometry)
        ranges_m = world.cast(pose.x_m, pose.y_m, pose.theta_rad + angles_rad)
        ranges_m = ranges_m + (0.005 + 0.002 * np.minimum(ranges_m, range_m)) * rng.standard_normal(n)
        ranges.append(np.where(ranges_m < range_m, ranges_m, range_m))
    return Drive(
        poses=np.array([(p.x_m, p.y_m, p.theta_rad) for p in poses]),
        odometry=measured,
        ranges_m=ranges,
        angles_rad=angles_rad,
        range_m=range_m,
    )


def carmen(drive: Drive) -> Iterator[str]:
    """Yield the drive as ROBOTLASER1 lines, with the maximum range for beams without a return."""
    step_rad = drive.angles_rad[1] - drive.angles_rad[0]
    fov_rad = drive.angles_rad[-1] - drive.angles_rad[0]
    for k, (pose, ranges_m) in enumerate(zip(drive.odometry, drive.ranges_m, strict=True)):
        ranges = " ".join(f"{r:.3f}" for r in ranges_m)
        at = f"{pose.x_m:.4f} {pose.y_m:.4f} {pose.theta_rad:.5f}"
        yield (
            f"ROBOTLASER1 0 {drive.angles_rad[0]:.6f} {fov_rad:.6f} {step_rad:.6f} {drive.range_m:.2f} "
            f"0.01 0 {len(ranges_m)} {ranges} 0 {at} {at} 0 0 0 0 0 {0.1 * k:.3f} nohost {0.1 * k:.3f}\n"
        )


def relations(poses: FloatArray) -> FloatArray:
    """Return the true relative poses: i, j, dx, dy, dtheta, shape (n, 5)."""
    path_m = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))))
    first = np.arange(0, len(poses), 5)
    pairs = [np.column_stack((first, np.searchsorted(path_m, path_m[first] + d))) for d in (1.0, 10.0)]
    apart_m = np.hypot(*(poses[first, None, :2] - poses[None, first, :2]).transpose(2, 0, 1))
    between_m = path_m[first][None, :] - path_m[first][:, None]
    revisits = np.argwhere((apart_m < REVISIT_M) & (between_m > 10.0 + REVISIT_M))
    table = np.concatenate((*pairs, 5 * revisits))
    table = table[table[:, 1] < len(poses)]
    one, two = poses[table[:, 0]], poses[table[:, 1]]
    cos, sin = np.cos(one[:, 2]), np.sin(one[:, 2])
    dx, dy = (two - one)[:, 0], (two - one)[:, 1]
    return np.column_stack((table, cos * dx + sin * dy, cos * dy - sin * dx, two[:, 2] - one[:, 2]))


def run(range_m: float, fov_deg: int, method: Method, seed: int, folder: Path) -> tuple[str, bool]:
    """Map one log; return a line of figures, and True if no relative pose failed."""
    made, path = drive(range_m, fov_deg, seed), folder / "synthetic.log"
    with path.open("w") as stream:
        stream.writelines(carmen(made))
    log, start_s = open_log(path), time.process_time()
    mapped = map_records(log, MappingOptions(method=method, filter=RbpfOptions(seed=seed)))
    cpu_s = time.process_time() - start_s
    truth = relations(made.poses)
    raw = np.array([(p.x_m, p.y_m, p.theta_rad) for p in made.odometry])
    alone, path_errors, online = (relation_errors(p, truth) for p in (raw, mapped.poses, mapped.online))
    good = bool(path_errors.translation_m.max() < FAILED_M)
    figure(
        f"{method}, lidar of {range_m:.0f} m and {fov_deg} deg, seed {seed}: path error, mean / worst",
        f"{path_errors.translation_m.mean():.3f} / {path_errors.translation_m.max():.2f}",
        "m",
        peers=f"odometry {alone.translation_m.mean():.2f}",
    )
    return (
        f"{range_m:.0f} m | {fov_deg} | {method} | {seed} | {alone.translation_m.mean():.2f} | "
        f"{path_errors.translation_m.mean():.3f} / {path_errors.translation_m.max():.2f} | "
        f"{np.degrees(path_errors.rotation_rad).mean():.2f} | {online.translation_m.mean():.3f} | "
        f"{1e3 * cpu_s / len(log.records):.1f}{'' if good else ' | FAILED'}"
    ), good


def main() -> None:
    """Print one line per lidar, method and seed."""
    parser = argparse.ArgumentParser(description="SLAM on synthetic logs of many lidars")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--range", nargs="+", type=float, default=list(PLACES), choices=list(PLACES))
    parser.add_argument("--fov", nargs="+", type=int, default=list(BEAMS), choices=list(BEAMS))
    methods = ("slam", "scan_match", "rbpf")
    parser.add_argument("--method", nargs="+", default=methods, choices=methods)
    arguments = parser.parse_args()
    for range_m in arguments.range:
        print(f"{range_m:.0f} m: {PLACES[range_m][0]}")
    print("range | degrees | method | seed | odometry, m | path, m, mean / worst | deg | online | ms")
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for range_m, fov_deg, method, seed in itertools.product(
            arguments.range, arguments.fov, arguments.method, range(1, arguments.seeds + 1)
        ):
            line, good = run(range_m, fov_deg, method, seed, Path(folder))
            failed += not good
            print(line, flush=True)
    print(f"{failed} failed: error of {FAILED_M} m or more in a relative pose")


if __name__ == "__main__":
    main()
