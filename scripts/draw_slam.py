"""Draw the pictures of docs/explanation/slam.md into docs/images/, from simulated drives.

Run: python scripts/draw_slam.py (half a minute). Run it again after a change of the mapping.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.slam_truth import LIDARS, PLACES, Place, drive

from thumper.common.colours import BLUE, OCCUPIED_COLOUR, RED
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.deskew import scan_points
from thumper.maps.occupancy_grid import OCCUPIED, OccupancyGrid
from thumper.maps.plot import draw_grid, save_figure
from thumper.slam.factory import MappingOptions, Method, make_mapper
from thumper.slam.mapper import Mapper

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
DPI = 100
VIEW_M = 3.6  # around the robot, to either side


def start(name: str, method: Method) -> tuple[Place, np.random.Generator, Mapper]:
    """Return a place, the random numbers of its drive, and a mapper at its first pose."""
    build, lidar, _ = PLACES[name]
    rng = np.random.default_rng(1)
    world, poses = build(rng)
    mapper = make_mapper(MappingOptions(method=method), map_from_base=poses[0])
    mapper.warm_up()
    return Place(world=world, poses=poses, lidar=LIDARS[lidar]), rng, mapper


def two_axes(width_in: float, height_in: float, titles: tuple[str, str]) -> tuple[Figure, list[Axes]]:
    """Return a figure with two axes side by side."""
    figure = Figure(figsize=(width_in, height_in), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)  # draws without a display
    axes = [figure.add_subplot(1, 2, k + 1) for k in range(2)]
    for one, title in zip(axes, titles, strict=True):
        one.set_title(title, fontsize=10)
    return figure, axes


def draw_match(path: Path, scans: int = 330) -> None:
    """Draw a scan at the pose by odometry alone, and at the matched pose, in the map so far."""
    place, rng, mapper = start("rooms, LD19", "scan_match")
    for k, (_, odometry, scan) in enumerate(drive(place, rng)):
        matched = mapper.update(odometry, scan, Twist2()).map_from_base
        if k == scans:
            break
    hits_m = scan_points(scan, Twist2(), Pose2(), place.lidar.range_m).hits_m
    figure, axes = two_axes(7.4, 3.9, ("by odometry alone", "after matching"))
    for one, pose in zip(axes, (place.poses[0] @ odometry, matched), strict=True):
        draw_grid(one, mapper.grid())
        one.plot(*_in_map(pose, hits_m).T, ".", color=RED, markersize=2.5)
        one.plot(pose.x_m, pose.y_m, "o", color=BLUE, markersize=7)
        one.set_xlim(matched.x_m - VIEW_M, matched.x_m + VIEW_M)
        one.set_ylim(matched.y_m - VIEW_M, matched.y_m + VIEW_M)
    save_figure(figure, path, DPI)


def draw_loop(path: Path) -> None:
    """Draw the map of a long loop that was driven twice, without and with loop closure."""
    figure, axes = two_axes(7.4, 2.9, ("scan_match: no loop closure", "slam: loop closed"))
    methods: tuple[Method, Method] = ("scan_match", "slam")
    for one, method in zip(axes, methods, strict=True):
        place, rng, mapper = start("loop 100 x 60 m", method)
        for _, odometry, scan in drive(place, rng):
            mapper.update(odometry, scan, Twist2())
        track_m = mapper.path()
        one.plot(*_occupied_m(mapper.grid()).T, ".", color=OCCUPIED_COLOUR, markersize=0.6)
        one.plot(track_m[:, 0], track_m[:, 1], color=BLUE, linewidth=0.8)
        one.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    save_figure(figure, path, DPI)


def _in_map(pose: Pose2, points_m: FloatArray) -> FloatArray:
    cos, sin = np.cos(pose.theta_rad), np.sin(pose.theta_rad)
    return np.asarray(points_m @ np.array([[cos, sin], [-sin, cos]]) + (pose.x_m, pose.y_m))


def _occupied_m(grid: OccupancyGrid) -> FloatArray:
    rows, cols = np.nonzero(grid.cells == OCCUPIED)
    return np.column_stack((cols, rows)) * grid.resolution_m + (grid.origin_x_m, grid.origin_y_m)


if __name__ == "__main__":
    draw_match(IMAGES / "slam_match.png")
    draw_loop(IMAGES / "slam_loop.png")
