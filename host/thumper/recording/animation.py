"""Draw a recording as an animated picture: the map grows while the robot drives."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from PIL import Image

from thumper.common.colours import BLUE, ORANGE, RED, UNKNOWN_COLOUR
from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.files import write_whole
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.deskew import scan_points
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.maps.plot import draw_grid
from thumper.recording.export import last_map
from thumper.recording.reader import Recording
from thumper.ros import from_ros
from thumper.ros.topics import TOPICS

FRAMES_PER_S = 12
MAX_FRAMES = 600  # a longer drive is played faster
LAST_FRAME_MS = 3000  # the finished map stays longer
LONG_SIDE_PX, DPI = 720, 100
WEBP_QUALITY = 60
TOPICS_DRAWN = ("map", "pose", "plan", "scan")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Moment:
    """What is known at one time; points in the map frame, shape (n, 2) [m]."""

    time_s: float
    grid: OccupancyGrid | None = None
    pose: Pose2 | None = None
    plan_m: FloatArray
    echoes_m: FloatArray


def animate(recording: Recording, path: Path, speed: float) -> int:
    """Write an animated .webp or .gif of the drive, `speed` times as fast as it was; return its frames.

    Raises
    ------
    ThumperError
        The recording has no map or no pose, another program made it, or the file cannot be written.
    """
    run = recording.run_metadata()
    if run is None:
        raise ThumperError(
            f"{recording.name}: another program recorded it, so the robot's outline is unknown; "
            "draw its map with --png",
            exit_code=EXIT_USAGE,
        )
    final, driven_m = last_map(recording)
    recording.notes.clear()  # the second pass makes them again
    poses = list(_moments(recording, run.config.lidar.base_from_laser))
    if not poses:
        raise ThumperError(
            f"{recording.name}: it has no pose of the robot; draw its map with --png", exit_code=EXIT_USAGE
        )
    first = _first_to_show(poses)
    step_s = max(speed / FRAMES_PER_S, (poses[-1].time_s - poses[first].time_s) / MAX_FRAMES)
    picture = _Picture(final, np.array(run.config.footprint.vertices_m), step_s * FRAMES_PER_S)
    frames, next_s = [], poses[first].time_s
    for k, moment in enumerate(poses[first:], first):
        if moment.time_s >= next_s or k == len(poses) - 1:
            frames.append(picture.draw(moment, driven_m[: k + 1], moment.time_s - poses[0].time_s))
            next_s += step_s
    with write_whole(path) as stream:
        frames[0].save(
            stream,
            format=path.suffix[1:],
            save_all=True,
            append_images=frames[1:],
            duration=[round(1000 / FRAMES_PER_S)] * (len(frames) - 1) + [LAST_FRAME_MS],
            loop=0,  # for ever
            quality=WEBP_QUALITY,
        )
    return len(frames)


def _moments(recording: Recording, base_from_laser: Pose2) -> Iterator[_Moment]:
    """Yield what is known at each pose."""
    now = _Moment(time_s=0.0, plan_m=np.empty((0, 2)), echoes_m=np.empty((0, 2)))
    for recorded in recording.messages():
        topic = recorded.topic
        if topic not in TOPICS_DRAWN or recorded.type_name != TOPICS[topic].type_name:
            continue
        with suppress(ValueError):
            message = recorded.decode()
            if topic == "map":
                now = replace(now, grid=from_ros.grid_of(message))
            elif topic == "plan":
                now = replace(now, plan_m=from_ros.path_of(message)[:, :2])
            elif topic == "scan" and now.pose is not None:
                scan = from_ros.scan_of(message)
                points = scan_points(scan, Twist2(), base_from_laser, scan.range_max_m)
                now = replace(now, echoes_m=now.pose.apply(points.hits_m))
            elif topic == "pose":
                pose = from_ros.pose_of(message.pose.pose)
                now = replace(now, time_s=recorded.log_ns / 1e9, pose=pose)
                yield now


def _first_to_show(poses: Sequence[_Moment]) -> int:
    """Return the index of the first pose with a map and a scan: a still shows the first frame alone."""
    return next((k for k, one in enumerate(poses) if one.grid is not None and one.echoes_m.size), 0)


class _Picture:
    """One figure, as large as the last map, drawn again for each frame."""

    def __init__(self, final: OccupancyGrid, outline_m: FloatArray, speed: float) -> None:
        self._outline_m = outline_m
        self._speed = speed
        self._figure = Figure(facecolor=UNKNOWN_COLOUR, dpi=DPI)
        self._canvas = FigureCanvasAgg(self._figure)  # draws without a display
        self._axes = self._figure.add_axes((0.0, 0.0, 1.0, 1.0))
        draw_grid(self._axes, final)
        self._x_m, self._y_m = self._axes.get_xlim(), self._axes.get_ylim()
        size_m = np.array([self._x_m[1] - self._x_m[0], self._y_m[1] - self._y_m[0]])
        self._figure.set_size_inches(*(size_m * (LONG_SIDE_PX / DPI / size_m.max())))

    def draw(self, moment: _Moment, driven_m: FloatArray, elapsed_s: float) -> Image.Image:
        axes = self._axes
        axes.clear()
        if moment.grid is not None:
            draw_grid(axes, moment.grid)
        axes.plot(*driven_m.T, color=BLUE, linewidth=1.6, alpha=0.6)
        axes.plot(*moment.plan_m.T, "--", color=ORANGE, linewidth=1.6)
        axes.plot(*moment.echoes_m.T, ".", color=RED, markersize=2.5)
        if moment.pose is not None:
            axes.add_patch(Polygon(moment.pose.apply(self._outline_m), closed=True, color=BLUE, zorder=3))
        axes.text(
            0.01,
            0.985,
            f"{elapsed_s:.0f} s  ({self._speed:.0f} x real time)",
            transform=axes.transAxes,
            verticalalignment="top",
            fontsize=9,
        )
        axes.set(xlim=self._x_m, ylim=self._y_m)
        axes.set_axis_off()
        self._canvas.draw()  # type: ignore[no-untyped-call]
        rgba = np.asarray(self._canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        return Image.fromarray(rgba[:, :, :3].copy())
