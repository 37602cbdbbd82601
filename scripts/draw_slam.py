"""Draw the pictures of docs/explanation/slam.md into docs/images/, from simulated drives.

Run: python scripts/draw_slam.py (three minutes)
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.slam_truth import LIDARS, PLACES, Place, drive

from thumper.common.colours import BLUE, OCCUPIED_COLOUR, RED
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.deskew import scan_points
from thumper.maps.occupancy_grid import OCCUPIED, OccupancyGrid
from thumper.maps.plot import draw_grid, save_figure
from thumper.slam.factory import MappingOptions, Method, PathMapper, make_mapper

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
DPI = 100
SCANS = 330  # by then the wheels alone are a metre off
VIEW_M = 3.6  # around the robot, to either side


def new_figure(height_in: float) -> Figure:
    """Return a figure as wide as the page's text."""
    figure = Figure(figsize=(7.4, height_in), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)  # draws without a display
    return figure


def start(name: str, method: Method) -> tuple[Place, np.random.Generator, PathMapper]:
    """Return a place, the random numbers of its drive, and a mapper at its first pose."""
    build, lidar, _ = PLACES[name]
    rng = np.random.default_rng(1)
    world, poses = build(rng)
    mapper = make_mapper(MappingOptions(method=method), map_from_base=poses[0])
    return Place(world=world, poses=poses, lidar=LIDARS[lidar]), rng, mapper


def draw_match(path: Path) -> None:
    """Draw a scan at the pose by odometry alone, and at the matched pose, in the map so far."""
    place, rng, mapper = start("rooms, LD19", "scan_match")
    for k, (_, odometry, scan) in enumerate(drive(place, rng)):
        matched = mapper.update(odometry, scan, Twist2()).map_from_base
        if k == SCANS:
            break
    hits_m = scan_points(scan, Twist2(), Pose2(), place.lidar.range_m).hits_m
    figure = new_figure(3.9)
    poses_by = {"by odometry alone": place.poses[0] @ odometry, "after matching": matched}
    for k, (title, pose) in enumerate(poses_by.items()):
        axes = figure.add_subplot(1, 2, k + 1)
        draw_grid(axes, mapper.grid())
        axes.set_title(title, fontsize=10)
        axes.plot(*pose.apply(hits_m).T, ".", color=RED, markersize=2.5)
        axes.plot(pose.x_m, pose.y_m, "o", color=BLUE, markersize=7)
        axes.set_xlim(matched.x_m - VIEW_M, matched.x_m + VIEW_M)
        axes.set_ylim(matched.y_m - VIEW_M, matched.y_m + VIEW_M)
    save_figure(figure, path, DPI)


def draw_loop(path: Path) -> None:
    """Draw the map of a long loop that was driven twice, without and with loop closure."""
    figure = new_figure(2.8)
    methods: dict[str, Method] = {"scan_match: no loop closure": "scan_match", "slam: loop closed": "slam"}
    for k, (title, method) in enumerate(methods.items()):
        place, rng, mapper = start("loop 160 x 100 m", method)
        for _, odometry, scan in drive(place, rng):
            mapper.update(odometry, scan, Twist2())
        track_m = mapper.path()
        axes = figure.add_subplot(1, 2, k + 1)
        axes.set_title(title, fontsize=10)
        axes.plot(*_occupied_m(mapper.grid()).T, ".", color=OCCUPIED_COLOUR, markersize=0.4)
        axes.plot(track_m[:, 0], track_m[:, 1], color=BLUE, linewidth=0.8)
        axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    save_figure(figure, path, DPI)


def _occupied_m(grid: OccupancyGrid) -> FloatArray:
    rows, cols = np.nonzero(grid.cells == OCCUPIED)
    return np.asarray(np.column_stack((cols, rows)) * grid.resolution_m + (grid.origin_x_m, grid.origin_y_m))


if __name__ == "__main__":
    draw_match(IMAGES / "slam_match.png")
    draw_loop(IMAGES / "slam_loop.png")
