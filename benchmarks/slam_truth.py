"""SLAM against ground truth in simulated places that were not used for tuning: pose error, wall error.

Run: python benchmarks/slam_truth.py [--seeds N] [--method slam|scan_match|rbpf ...] [--place NAME ...]

Lidars of 4 to 80 m and 180 to 360 degrees. The odometry is 3 % too long, with drift and noise. In some places
the wheels spin on the spot.
"""

import argparse
import itertools
import math
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.ndimage import distance_transform_edt

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure
from benchmarks.shared.corridors import corridor_loop, round_trip

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.scan import Scan
from thumper.maps.occupancy_grid import OCCUPIED, OccupancyGrid
from thumper.slam.factory import MappingOptions, Method, make_mapper
from thumper_hil.world.world import World

NEAR_M = 0.1  # a mapped wall cell within this distance of a true wall is right


@dataclass(frozen=True, slots=True, kw_only=True)
class Lidar:
    """A sensor by its data sheet."""

    range_m: float
    fov_deg: float
    beams: int
    noise_m: float


LIDARS = {
    "4 m, 240 deg": Lidar(range_m=4.0, fov_deg=240.0, beams=341, noise_m=0.02),
    "12 m, 360 deg": Lidar(range_m=12.0, fov_deg=359.2, beams=450, noise_m=0.02),
    "30 m, 270 deg": Lidar(range_m=30.0, fov_deg=270.0, beams=541, noise_m=0.015),
    "80 m, 180 deg": Lidar(range_m=80.0, fov_deg=180.0, beams=181, noise_m=0.01),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Walls, a path through them, and the step at which the wheels spin for 25 steps (-1: never)."""

    world: World
    poses: list[Pose2]
    lidar: Lidar
    spins_at: int = -1


def rooms(rng: np.random.Generator) -> tuple[World, list[Pose2]]:
    """Return six randomly furnished rooms along a corridor, and a path in and out of each."""
    rows: list[tuple[float, float, float, float]] = [
        (0, 0, 18, 0),
        (0, 12, 18, 12),
        (0, 0, 0, 12),
        (18, 0, 18, 12),
    ]
    circles: list[tuple[float, float, float]] = []
    path = [(1.0, 6.0)]
    for k in range(3):
        x0, x1, door = 6.0 * k, 6.0 * (k + 1), 6.0 * k + 3.0
        for y, end in ((5.0, 0.0), (7.0, 12.0)):
            rows += [(x0, y, door - 0.6, y), (door + 0.6, y, x1, y)]
            if k:
                rows.append((x0, y, x0, end))
            for _ in range(4):
                cx, cy = rng.uniform(x0 + 0.6, x1 - 0.6), rng.uniform(min(y, end) + 0.6, max(y, end) - 0.6)
                if abs(cx - door) > 1.0:
                    circles.append((float(cx), float(cy), float(rng.uniform(0.1, 0.3))))
            inside = 2.5 if end == 0.0 else 9.5
            path += [(door, 6.0), (door, inside), (door, 6.0)]
    path += [(17.0, 6.0), (1.0, 6.0)]
    return World(segments_m=np.array(rows), circles_m=np.array(circles)), polyline(path)


def symmetric(rng: np.random.Generator) -> tuple[World, list[Pose2]]:
    """Return a square hall with equal pillars and a circular path; all quarters look the same."""
    del rng
    rows = [(0, 0, 14, 0), (14, 0, 14, 14), (14, 14, 0, 14), (0, 14, 0, 0)]
    pillars = [(x, y, 0.25) for x in (3.5, 10.5) for y in (3.5, 10.5)]
    ring = [(7 + 5.0 * math.cos(a), 7 + 5.0 * math.sin(a)) for a in np.arange(0.0, 4.2 * math.pi, 0.3)]
    return World(segments_m=np.array(rows, dtype=float), circles_m=np.array(pillars)), polyline(ring)


def bare(rng: np.random.Generator) -> tuple[World, list[Pose2]]:
    """Return 40 m of corridor without a feature, and a path there and back."""
    del rng
    rows = [(0, 0, 44, 0), (0, 2, 44, 2), (0, 0, 0, 2), (44, 0, 44, 2)]
    world = World(segments_m=np.array(rows, dtype=float), circles_m=np.zeros((0, 3)))
    return world, polyline([(1.5, 1.0), (42.0, 1.0), (1.5, 1.0)])


def loop(length_m: float, breadth_m: float) -> Callable[[np.random.Generator], tuple[World, list[Pose2]]]:
    """Return a builder for a rectangle of corridors with a path of two rounds."""

    def build(rng: np.random.Generator) -> tuple[World, list[Pose2]]:
        return corridor_loop(length_m, breadth_m, rng), 2 * round_trip(length_m, breadth_m, 0.0, step_m=0.1)

    return build


PLACES: dict[str, tuple[Callable[[np.random.Generator], tuple[World, list[Pose2]]], str, bool]] = {
    "rooms": (rooms, "4 m, 240 deg", False),
    "rooms, wheels spin": (rooms, "4 m, 240 deg", True),
    "rooms, LD19": (rooms, "12 m, 360 deg", False),
    "symmetric hall": (symmetric, "12 m, 360 deg", False),
    "bare corridor 44 m": (bare, "4 m, 240 deg", False),
    "bare corridor, wheels spin": (bare, "4 m, 240 deg", True),
    "loop 40 x 25 m": (loop(40.0, 25.0), "4 m, 240 deg", False),
    "loop 60 x 40 m": (loop(60.0, 40.0), "30 m, 270 deg", False),
    "loop 100 x 60 m": (loop(100.0, 60.0), "80 m, 180 deg", False),
    "loop 160 x 100 m": (loop(160.0, 100.0), "30 m, 270 deg", False),
    "loop 200 x 60 m": (loop(200.0, 60.0), "30 m, 270 deg", False),
}


def polyline(points: list[tuple[float, float]], step_m: float = 0.06, step_rad: float = 0.12) -> list[Pose2]:
    """Return poses straight along the points with turns on the spot, at 10 scans per second."""
    poses, heading = [], math.atan2(points[1][1] - points[0][1], points[1][0] - points[0][0])
    for (x0, y0), (x1, y1) in itertools.pairwise(points):
        aim, length = math.atan2(y1 - y0, x1 - x0), math.hypot(x1 - x0, y1 - y0)
        turn = math.remainder(aim - heading, math.tau)
        for part in np.linspace(0.0, 1.0, max(1, math.ceil(abs(turn) / step_rad)), endpoint=False):
            poses.append(Pose2(x_m=x0, y_m=y0, theta_rad=heading + part * turn))
        for part in np.linspace(0.0, 1.0, max(1, math.ceil(length / step_m)), endpoint=False):
            poses.append(Pose2(x_m=x0 + part * (x1 - x0), y_m=y0 + part * (y1 - y0), theta_rad=aim))
        heading = aim
    return poses


def drive(place: Place, rng: np.random.Generator) -> Iterator[tuple[Pose2, Pose2, Scan]]:
    """Yield true pose, odometry and scan of each step; spinning wheels add steps without motion."""
    odometry, lidar = Pose2(), place.lidar
    angles = np.radians(np.linspace(-0.5 * lidar.fov_deg, 0.5 * lidar.fov_deg, lidar.beams))
    poses = list(place.poses)
    if place.spins_at >= 0:
        poses[place.spins_at : place.spins_at] = 25 * [poses[place.spins_at]]
    for k, (before, pose) in enumerate(zip([poses[0], *poses[:-1]], poses, strict=True)):
        step = before.inverse() @ pose
        length_m = math.hypot(step.x_m, step.y_m)
        noise = rng.standard_normal(2) * math.sqrt(length_m)
        spun_m = 0.04 if place.spins_at >= 0 and place.spins_at <= k < place.spins_at + 25 else 0.0
        odometry = odometry @ Pose2(
            x_m=1.03 * step.x_m + 0.01 * noise[0] + spun_m,
            y_m=step.y_m,
            theta_rad=1.05 * step.theta_rad + 0.004 * length_m + 0.01 * noise[1],
        )
        ranges_m = place.world.cast(pose.x_m, pose.y_m, pose.theta_rad + angles)
        ranges_m = ranges_m + lidar.noise_m * rng.standard_normal(lidar.beams)
        scan = Scan(
            time_s=0.1 * k,
            ranges_m=np.where(ranges_m < lidar.range_m, ranges_m, np.nan),
            angle_min_rad=float(angles[0]),
            angle_increment_rad=float(angles[1] - angles[0]),
            range_max_m=lidar.range_m,
        )
        yield pose, odometry, scan


def wall_figures(grid: OccupancyGrid, world: World) -> tuple[float, float]:
    """Return the IoU of walls widened by `NEAR_M`, and the mean distance of mapped cells to walls [m]."""
    true = np.zeros(grid.cells.shape, dtype=np.bool_)
    seen = np.asarray(grid.cells == OCCUPIED)
    points = [np.linspace(a, b, max(2, math.ceil(math.dist(a, b) / 0.02))) for a, b in _sides(world)]
    points += [
        np.column_stack((x + r * np.cos(t), y + r * np.sin(t)))
        for x, y, r in world.circles_m
        for t in [np.linspace(0.0, math.tau, 90)]
    ]
    for x_m, y_m in np.concatenate(points):
        row, col = grid.cell_of(float(x_m), float(y_m))
        if grid.contains(row, col):
            true[row, col] = True
    to_true = distance_transform_edt(~true) * grid.resolution_m
    to_seen = distance_transform_edt(~seen) * grid.resolution_m
    known = distance_transform_edt(grid.cells < 0) * grid.resolution_m > 0.0
    observed = true & (known | (to_seen < NEAR_M))  # a wall that was never observed is not an error
    right_seen, right_true = (
        int((seen & (to_true <= NEAR_M)).sum()),
        int((observed & (to_seen <= NEAR_M)).sum()),
    )
    union = int(seen.sum()) + int(observed.sum())
    return (right_seen + right_true) / max(1, union), float(to_true[seen].mean())


def _sides(world: World) -> Iterator[tuple[tuple[float, float], tuple[float, float]]]:
    for x0, y0, x1, y1 in world.segments_m:
        yield (float(x0), float(y0)), (float(x1), float(y1))


def run(name: str, method: Method, seed: int) -> tuple[str, ...]:
    """Map a place; return a row of figures."""
    build, lidar, spins = PLACES[name]
    rng = np.random.default_rng(seed)
    world, poses = build(rng)
    place = Place(world=world, poses=poses, lidar=LIDARS[lidar], spins_at=len(poses) // 3 if spins else -1)
    mapper = make_mapper(MappingOptions(method=method), map_from_base=poses[0])
    mapper.warm_up()
    truth, online, wheels, cpu_ms, lost = [], [], [], [], 0
    for pose, odometry, scan in drive(place, rng):
        start_s = time.process_time()
        update = mapper.update(odometry, scan, Twist2())
        cpu_ms.append(1e3 * (time.process_time() - start_s))
        lost += mapper.quality().lost != ""
        truth.append((pose.x_m, pose.y_m))
        online.append((update.map_from_base.x_m, update.map_from_base.y_m))
        raw = poses[0] @ odometry
        wheels.append((raw.x_m, raw.y_m))
    errors = [np.hypot(*(np.asarray(track) - truth).T) for track in (mapper.path()[:, :2], online, wheels)]
    final, now, raw_m = (f"{_rmse(error):.2f} / {error.max():.2f}" for error in errors)
    iou, offset_m = wall_figures(mapper.grid(), world)
    share = f"{100.0 * lost / len(truth):.0f} %"
    wheels_m = raw_m.split(" ", maxsplit=1)[0]
    figure(f"{method} in {name}: path error, rms / worst", final, "m", peers=f"odometry {wheels_m}")
    timing = f"{np.mean(cpu_ms):.2f} / {np.percentile(cpu_ms, 99):.1f} / {np.max(cpu_ms):.0f}"
    return name, lidar, method, str(seed), raw_m, final, now, f"{iou:.2f}", f"{offset_m:.3f}", share, timing


def _rmse(error_m: FloatArray) -> float:
    return math.sqrt(float(np.mean(error_m**2)))


def main() -> None:
    """Print one row per place, method and seed."""
    parser = argparse.ArgumentParser(description="SLAM against ground truth")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument(
        "--method", nargs="+", default=["slam", "scan_match"], choices=("slam", "scan_match", "rbpf")
    )
    parser.add_argument("--place", nargs="+", default=list(PLACES), choices=list(PLACES))
    arguments = parser.parse_args()
    table = Table(title="Errors in metres, RMSE / max; CPU in ms, mean / 99 % / worst")
    for column in (
        "place",
        "lidar",
        "method",
        "seed",
        "odometry",
        "path",
        "online",
        "IoU",
        "offset",
        "lost",
        "CPU",
    ):
        table.add_column(column)
    for name, method, seed in itertools.product(
        arguments.place, arguments.method, range(1, arguments.seeds + 1)
    ):
        row = run(name, method, seed)
        table.add_row(*row)
        print(" | ".join(row), flush=True)
    Console(width=170).print(table)


if __name__ == "__main__":
    main()
