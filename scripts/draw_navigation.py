"""Draw the pictures of docs/explanation/navigation.md and localization.md into docs/images/.

Run: python scripts/draw_navigation.py (ten seconds)
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.rooms import rectangle

from tests.host.slam.localization.test_three_places import WITH_BOX, A, B, C, map_and_scan
from thumper.common.colours import BLUE, FREE_COLOUR, GREY, OCCUPIED_COLOUR, ORANGE, RED
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.deskew import scan_points
from thumper.maps.plot import draw_grid, save_figure
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions, build_costmap, inflation_table
from thumper.navigation.costmap.inflation import INSCRIBED, LETHAL
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.options import NavigationOptions
from thumper.navigation.planners.astar import AStarPlanner
from thumper.slam.localization.likelihood_field import LikelihoodField
from thumper.slam.localization.options import AmclOptions
from thumper.slam.localization.scan_likelihood import ScanLikelihood
from thumper_hil.world.world import World

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
DPI = 100
ROOM = np.concatenate((rectangle(0.0, 0.0, 4.6, 3.0), [[2.0, 0.0, 2.0, 1.2], [3.2, 1.7, 3.2, 3.0]]))
START, GOAL = Pose2(x_m=0.8, y_m=0.7, theta_rad=0.9), Goal(x_m=4.0, y_m=2.3)
COST_COLOUR, INSCRIBED_COLOUR = "#e0559b", "#8a2f62"  # as on the dashboard


def new_figure(height_in: float) -> Figure:
    """Return a figure as wide as the page's text."""
    figure = Figure(figsize=(7.4, height_in), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)  # draws without a display
    return figure


def draw_costmap(path: Path) -> None:
    """Draw a room's costs with a planned path, and the cost over the distance to an obstacle."""
    grid = World(segments_m=ROOM, circles_m=np.zeros((0, 3))).to_grid()
    footprint, options = Footprint(), NavigationOptions()
    costmap = build_costmap(grid, np.zeros((0, 2)), footprint, options.costmap)
    planned_m = AStarPlanner(options.traversal).plan(costmap, START, GOAL).path_m
    assert planned_m is not None
    figure = new_figure(3.3)
    axes, curve = figure.subplots(1, 2, width_ratios=(1.75, 1.0))
    _draw_costs(axes, costmap)
    axes.plot(*planned_m.T, color=ORANGE, linewidth=2)
    axes.plot(GOAL.x_m, GOAL.y_m, "*", color=ORANGE, markersize=13)
    axes.fill(*START.apply(footprint.polygon_m()).T, color=BLUE)
    axes.set_title("costs, and the path of A*", fontsize=10)
    _draw_cost_curve(curve, footprint, options.costmap)
    save_figure(figure, path, DPI)


def _draw_costs(axes: Axes, costmap: Costmap) -> None:
    colours = np.ones((256, 4))
    fade = np.arange(INSCRIBED)[:, None] / INSCRIBED
    colours[:INSCRIBED, :3] = _rgb(FREE_COLOUR) * (1.0 - fade) + _rgb(COST_COLOUR) * fade
    colours[INSCRIBED, :3], colours[LETHAL, :3] = _rgb(INSCRIBED_COLOUR), _rgb(OCCUPIED_COLOUR)
    rows, columns = costmap.costs.shape
    axes.imshow(
        costmap.costs,
        cmap=ListedColormap(colours),
        vmin=0,
        vmax=255,
        origin="lower",
        interpolation="nearest",
        extent=(
            costmap.origin_x_m,
            costmap.origin_x_m + columns * costmap.resolution_m,
            costmap.origin_y_m,
            costmap.origin_y_m + rows * costmap.resolution_m,
        ),
    )
    axes.set(xlabel="x [m]", ylabel="y [m]", xlim=(-0.15, 4.75), ylim=(-0.15, 3.15))


def _draw_cost_curve(axes: Axes, footprint: Footprint, options: CostmapOptions) -> None:
    cell_m = 0.005
    costs = inflation_table(footprint, options, cell_m)
    distances_m = np.sqrt(np.arange(costs.size)) * cell_m
    axes.plot(distances_m, costs, color=INSCRIBED_COLOUR, linewidth=2)
    for radius_m, text in (
        (footprint.inscribed_radius_m, "inscribed\nradius"),
        (options.inflation_radius_m, "inflation\nradius"),
    ):
        axes.axvline(radius_m, color=GREY, linewidth=1, linestyle="--")
        axes.annotate(text, (radius_m, 222), xytext=(9, 0), textcoords="offset points", fontsize=9)
    axes.set(xlabel="distance to the obstacle [m]", xlim=(0.0, 0.8), ylim=(0, 265))
    axes.set_title("cost", fontsize=10)


def _rgb(colour: str) -> FloatArray:
    return np.array([int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])


def draw_three_places(path: Path) -> None:
    """Draw one scan at three places of a room with a box: the case of a test."""
    grid, scan = map_and_scan(WITH_BOX)
    likelihood = ScanLikelihood.of(scan, Twist2(), Pose2(), LikelihoodField(grid), AmclOptions())
    hits_m = scan_points(scan, Twist2(), Pose2(), scan.range_max_m).hits_m
    figure = new_figure(2.5)
    for axes, (name, place) in zip(figure.subplots(1, 3), {"A": A, "B": B, "C": C}.items(), strict=True):
        pose = likelihood.refine_pose(place).pose
        draw_grid(axes, grid)
        axes.plot(*pose.apply(hits_m).T, ".", color=RED, markersize=2.5)
        axes.plot(*pose.apply(np.array([[0.0, 0.0], [0.5, 0.0]])).T, color=BLUE, linewidth=2)
        axes.plot(pose.x_m, pose.y_m, "o", color=BLUE, markersize=7)
        axes.set_title(f"{name}: fit {likelihood.fit(pose):.2f}", fontsize=10)
        axes.set(xlabel="", ylabel="", xticks=[], yticks=[], xlim=(-3.6, 3.6), ylim=(-2.6, 2.6))
    save_figure(figure, path, DPI)


if __name__ == "__main__":
    draw_costmap(IMAGES / "costmap.png")
    draw_three_places(IMAGES / "three_places.png")
