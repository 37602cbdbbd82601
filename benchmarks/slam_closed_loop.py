"""SLAM in closed loop: a simulated robot drives tours with its own map; pose and wall errors.

Run: python benchmarks/slam_closed_loop.py [--seeds N] [--place NAME ...] [--method METHOD] [--track M]
                                           [--slip SHARE] [--preset hard] [--without EFFECT ...]
                                           [--beam-std M]

The whole host software drives the firmware on the simulated chip. The wheels differ from the configured
geometry, and they slip and drift. The odometry error is that of experiment 1 of the thesis: like the thesis
it uses the track between the wheels (0.245 m), although a skid-steered base turns as if the track were wider.
The wheel speed error follows the thesis's definition. With `--slip` the left wheels lose that share of their
travel on the second leg. `--without 'mount.*'` sets the effects whose names match to their values in nominal;
`hil/thumper_hil/effects/hard.toml` has the names.
"""

import argparse
import itertools
import math
import sys
import tempfile
from dataclasses import fields, replace
from fnmatch import fnmatch
from pathlib import Path
from unittest.mock import patch

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure
from benchmarks.slam_truth import wall_figures

from thumper import Robot
from thumper.common.geometry import FloatArray, Pose2
from thumper.slam.scan_matching.gauss_newton import MatchOptions
from thumper_hil.bench.registry import simulation
from thumper_hil.effects.preset import PRESETS, Preset, load_preset
from thumper_hil.world.world import World

GEOMETRIC_TRACK_M, RADIUS_M = 0.245, 0.062  # the thesis's
SMOOTHING = 10  # of 100 Hz samples: the thesis low-pass filtered its speeds
STEP_S = 0.01

Points = list[tuple[float, float]]

# Closed polylines of walls, and the goals of the tour; the robot starts at the first one.
PLACES: dict[str, tuple[list[Points], Points]] = {
    "rooms": (
        [
            [(0, 0), (9, 0), (9, 7), (0, 7)],
            [(0, 3), (1.6, 3), (1.6, 3.1), (0, 3.1)],
            [(2.8, 3), (6.2, 3), (6.2, 3.1), (2.8, 3.1)],
            [(7.4, 3), (9, 3), (9, 3.1), (7.4, 3.1)],
            [(4.5, 0), (4.6, 0), (4.6, 3), (4.5, 3)],
            [(0.4, 0.4), (1.1, 0.4), (1.1, 0.9), (0.4, 0.9)],
            [(8.0, 6.2), (8.7, 6.2), (8.7, 6.7), (8.0, 6.7)],
        ],
        [(1.2, 5.0), (7.0, 5.0), (6.8, 1.5), (6.8, 4.6), (2.2, 4.6), (2.2, 1.6), (1.2, 5.0)],
    ),
    "corridor": (
        [[(0, 0), (14, 0), (14, 1.8), (9.4, 1.8), (9.4, 2.2), (8.6, 2.2), (8.6, 1.8), (0, 1.8)]],
        [(1.0, 0.9), (13.0, 0.9), (1.0, 0.9)],
    ),
    "loop": (
        [[(0, 0), (9, 0), (9, 7), (0, 7)], [(1.8, 1.8), (7.2, 1.8), (7.2, 5.2), (1.8, 5.2)]],
        [(0.9, 0.9), (8.1, 0.9), (8.1, 6.1), (0.9, 6.1), (0.9, 0.9)],
    ),
    "symmetric": (
        [
            [(0, 0), (6, 0), (6, 6), (0, 6)],
            *[
                [(x - 0.2, y - 0.2), (x + 0.2, y - 0.2), (x + 0.2, y + 0.2), (x - 0.2, y + 0.2)]
                for x in (1.8, 4.2)
                for y in (1.8, 4.2)
            ],
        ],
        [(3.0, 3.0), (5.2, 3.0), (3.0, 5.2), (0.8, 3.0), (3.0, 0.8), (3.0, 3.0)],
    ),
}


def preset_without(name: str, effects: list[str]) -> Preset:
    """Return a preset with the values of `nominal` for the effects that match, such as `mount.*`."""
    preset, nominal = load_preset(name), load_preset("nominal")
    for part in fields(preset):
        mild = getattr(nominal, part.name)
        off = {
            field.name: getattr(mild, field.name)
            for field in fields(mild)
            if any(fnmatch(f"{part.name}.{field.name}", effect) for effect in effects)
        }
        preset = replace(preset, **{part.name: replace(getattr(preset, part.name), **off)})
    return preset


def world_toml(walls: list[Points]) -> str:
    """Return the walls as a world file."""
    return "".join(f"[[wall]]\nclosed = true\npoints_m = {[list(p) for p in wall]}\n" for wall in walls)


def pose_errors(poses: FloatArray, truth: FloatArray) -> FloatArray:
    """Return the distance of each estimated pose from the true one [m]; both arrays start with t, x, y."""
    true_xy = [np.interp(poses[:, 0], truth[:, 0], truth[:, axis]) for axis in (1, 2)]
    return np.asarray(np.hypot(poses[:, 1] - true_xy[0], poses[:, 2] - true_xy[1]))


def wheel_errors(truth: FloatArray) -> FloatArray:
    """Return encoder wheel speeds minus those from the motion (thesis, 8.1 to 8.5), shape (n, 2)."""
    time_s = np.arange(truth[0, 0], truth[-1, 0], STEP_S)
    x_m, y_m, left, right = (np.interp(time_s, truth[:, 0], truth[:, k]) for k in (1, 2, 4, 5))
    heading = np.interp(time_s, truth[:, 0], np.unwrap(truth[:, 3]))
    along = np.cos(heading) * np.gradient(x_m, STEP_S) + np.sin(heading) * np.gradient(y_m, STEP_S)
    half_turn = 0.5 * GEOMETRIC_TRACK_M * np.gradient(heading, STEP_S)
    window = np.ones(SMOOTHING) / SMOOTHING
    errors = (left - (along - half_turn) / RADIUS_M, right - (along + half_turn) / RADIUS_M)
    return np.column_stack([np.convolve(error, window, "valid") for error in errors])


def dead_reckoning(truth: FloatArray, track_m: float, start: Pose2) -> FloatArray:
    """Return the poses from the wheel speeds alone; rows t, x, y."""
    dt_s = np.diff(truth[:, 0], prepend=truth[0, 0])
    left_m, right_m = RADIUS_M * truth[:, 4] * dt_s, RADIUS_M * truth[:, 5] * dt_s
    heading = start.theta_rad + np.cumsum((right_m - left_m) / track_m)
    x_m = start.x_m + np.cumsum(0.5 * (left_m + right_m) * np.cos(heading))
    y_m = start.y_m + np.cumsum(0.5 * (left_m + right_m) * np.sin(heading))
    return np.column_stack((truth[:, 0], x_m, y_m))


def run(place: str, seed: int, arguments: argparse.Namespace, folder: Path) -> str:
    """Drive a tour; return a line of figures."""
    walls, tour = PLACES[place]
    path, config = folder / f"{place}.toml", folder / "robot.toml"
    path.write_text(world_toml(walls))
    track_m, method = arguments.track, arguments.method
    config.write_text(
        f'[drive]\ntrack_m = {track_m}\n[mapping]\nmethod = "{method}"\n'
        f"[mapping.matching]\nbeam_std_m = {arguments.beam_std}\n"
    )
    name, start = f"{place}{seed}", Pose2(x_m=tour[0][0], y_m=tour[0][1])
    board = f"sim://{name}/board?world={path}&x_m={start.x_m}&y_m={start.y_m}&seed={seed}&preset={arguments.preset}"
    with Robot(board, lidar=f"sim://{name}/lidar", config=config, start=start) as robot:
        bench = simulation(name)
        results = []
        for leg, (x_m, y_m) in enumerate(tour[1:], start=1):
            bench.fault("slip.left", arguments.slip if leg == 2 else 0.0)
            results.append(robot.goto(x_m, y_m, tolerance_m=0.15))
        error_m = pose_errors(robot.log.poses, bench.truth())
        odometry_m = pose_errors(dead_reckoning(bench.truth(), track_m, start), bench.truth())
        iou, offset_m = wall_figures(robot.map, World.load(path))
        wheels = wheel_errors(bench.truth())
    length_m = float(np.hypot(*np.diff(bench.truth()[:, 1:3], axis=0).T).sum())
    sides = ", ".join(f"{side.mean():+.2f} / {side.std():.2f}" for side in wheels.T)
    failed = "".join(f" | {result.reason}" for result in results if not result.reached)
    errors = f"{math.sqrt(float((error_m**2).mean())):.3f} / {error_m.max():.3f}"
    odometry = f"{math.sqrt(float((odometry_m**2).mean())):.2f} / {odometry_m.max():.2f}"
    what = f"{method} driving {place}, seed {seed}: pose error, rms / worst"
    figure(what, errors, "m", peers=f"odometry {odometry}")
    return (
        f"{place} | {seed} | {len(results) - failed.count('|')} of {len(results)} | {length_m:.1f} | "
        f"{errors} | {iou:.2f} | {offset_m:.3f} | {odometry} | {sides}{failed}"
    )


def main() -> None:
    """Print one line per place and seed."""
    parser = argparse.ArgumentParser(description="SLAM in closed loop")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--place", nargs="+", default=list(PLACES), choices=list(PLACES))
    parser.add_argument("--method", default="slam", choices=("slam", "scan_match", "rbpf"))
    parser.add_argument("--preset", choices=PRESETS, default="nominal")
    parser.add_argument(
        "--track",
        type=float,
        default=GEOMETRIC_TRACK_M,
        help="track that odometry uses, m",
    )
    parser.add_argument(
        "--slip", type=float, default=0.0, help="share of the left wheels' travel that is lost, 0...1"
    )
    parser.add_argument(
        "--without",
        nargs="+",
        default=[],
        metavar="EFFECT",
        help="give these effects of the preset the values of nominal, e.g. 'mount.*' body.floor",
    )
    parser.add_argument(
        "--beam-std", type=float, default=MatchOptions().beam_std_m, help="beam_std_m of the scan match, m"
    )
    arguments = parser.parse_args()
    print(
        "place | seed | goals reached | path, m | pose error, m, RMSE / max | IoU | offset, m | "
        "odometry error, m | wheel speed error, rad/s, left and right, mean / std"
    )
    preset = preset_without(arguments.preset, arguments.without)
    with (
        tempfile.TemporaryDirectory() as folder,
        patch("thumper_hil.bench.bench.load_preset", lambda _: preset),
    ):
        for place, seed in itertools.product(arguments.place, range(1, arguments.seeds + 1)):
            print(run(place, seed, arguments, Path(folder)), flush=True)


if __name__ == "__main__":
    main()
