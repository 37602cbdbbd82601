"""Draws the robot in its map: the plans, the driven path, the newest scan, the outline of the robot."""

from io import BytesIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thumper.common.colours import BLUE, ORANGE, RED, UNKNOWN_COLOUR
from thumper.common.geometry import FloatArray, Pose2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.maps.plot import draw_grid
from thumper.navigation.footprint import Footprint
from thumper.navigation.planners.polyline import arc_lengths
from thumper.runtime.drive_log import DriveLog

SHORTEST_PLAN_M = 0.1  # exploration starts with a plan to the current position
SIZE_IN = 6.0


class RobotFigure(Figure):
    """A figure that a notebook shows by itself, without pyplot."""

    def png(self) -> bytes:
        """Return the picture as PNG."""
        stream = BytesIO()
        self.savefig(stream, format="png")
        return stream.getvalue()

    def _repr_png_(self) -> bytes:
        return self.png()


def draw_drive(axes: Axes, log: DriveLog) -> None:
    """Draw the first plan (later ones thin) and the driven path by the robot's own estimate."""
    plans = [plan for plan in log.plans if arc_lengths(plan)[-1] > SHORTEST_PLAN_M]
    if plans:
        for plan in plans[1:]:
            axes.plot(*plan.T, color=ORANGE, linewidth=0.6, alpha=0.35)
        axes.plot(*plans[0].T, "--", color=ORANGE, linewidth=1.6, label="planned at the start (thin: later)")
    poses = log.poses
    axes.plot(poses[:, 1], poses[:, 2], color=BLUE, linewidth=2.0, label="driven (own estimate)")


def draw_robot(axes: Axes, map_from_base: Pose2, footprint: Footprint, hits_in_map_m: FloatArray) -> None:
    """Draw the robot's outline with its heading, and the points of its newest scan, shape (n, 2) [m]."""
    outline_m = map_from_base.apply(footprint.polygon_m())
    length_m = float(footprint.polygon_m()[:, 0].max())
    nose_m = map_from_base.apply(np.array([[length_m, 0.0], [0.0, 0.4 * length_m], [0.0, -0.4 * length_m]]))
    axes.plot(*hits_in_map_m.T, ".", color=RED, markersize=2, label="newest scan")
    axes.fill(*outline_m.T, facecolor="none", edgecolor=BLUE, linewidth=1.5)
    axes.fill(*nose_m.T, color=BLUE)


def robot_figure(
    grid: OccupancyGrid, log: DriveLog, map_from_base: Pose2, footprint: Footprint, hits_in_map_m: FloatArray
) -> RobotFigure:
    """Return a figure of the robot in its map; `savefig` writes it."""
    figure = RobotFigure(figsize=(SIZE_IN, SIZE_IN), layout="constrained")
    axes = figure.subplots()
    draw_grid(axes, grid)
    axes.set_facecolor(UNKNOWN_COLOUR)
    draw_drive(axes, log)
    draw_robot(axes, map_from_base, footprint, hits_in_map_m)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False, fontsize=8)
    return figure
