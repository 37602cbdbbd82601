"""Draw the picture of docs/explanation/slam.md into docs/images/: a scan before and after the match.

Run: python scripts/draw_slam.py
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.slam_truth import LIDARS, PLACES, Place, drive

from thumper.common.colours import BLUE, RED
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.deskew import scan_points
from thumper.maps.plot import draw_grid, save_figure
from thumper.slam.factory import MappingOptions, make_mapper

PICTURE = Path(__file__).resolve().parents[1] / "docs" / "images" / "slam_match.png"
DPI = 100
SCANS = 330  # by then the wheels alone are a metre off
VIEW_M = 3.6  # around the robot, to either side


def draw_match(path: Path) -> None:
    """Draw a scan at the pose by odometry alone, and at the matched pose, in the map so far."""
    build, lidar, _ = PLACES["rooms, LD19"]
    rng = np.random.default_rng(1)
    world, poses = build(rng)
    place = Place(world=world, poses=poses, lidar=LIDARS[lidar])
    mapper = make_mapper(MappingOptions(method="scan_match"), map_from_base=poses[0])
    for k, (_, odometry, scan) in enumerate(drive(place, rng)):
        matched = mapper.update(odometry, scan, Twist2()).map_from_base
        if k == SCANS:
            break
    hits_m = scan_points(scan, Twist2(), Pose2(), place.lidar.range_m).hits_m
    figure = Figure(figsize=(7.4, 3.9), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)  # draws without a display
    poses_by = {"by odometry alone": poses[0] @ odometry, "after matching": matched}
    for k, (title, pose) in enumerate(poses_by.items()):
        axes = figure.add_subplot(1, 2, k + 1)
        draw_grid(axes, mapper.grid())
        axes.set_title(title, fontsize=10)
        axes.plot(*_in_map(pose, hits_m).T, ".", color=RED, markersize=2.5)
        axes.plot(pose.x_m, pose.y_m, "o", color=BLUE, markersize=7)
        axes.set_xlim(matched.x_m - VIEW_M, matched.x_m + VIEW_M)
        axes.set_ylim(matched.y_m - VIEW_M, matched.y_m + VIEW_M)
    save_figure(figure, path, DPI)


def _in_map(pose: Pose2, points_m: FloatArray) -> FloatArray:
    cos, sin = np.cos(pose.theta_rad), np.sin(pose.theta_rad)
    return np.asarray(points_m @ np.array([[cos, sin], [-sin, cos]]) + (pose.x_m, pose.y_m))


if __name__ == "__main__":
    draw_match(PICTURE)
