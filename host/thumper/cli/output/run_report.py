"""The pictures and files that a run writes."""

import json
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
from matplotlib.figure import Figure

from thumper.common.colours import BLUE, GREEN
from thumper.common.files import write_text
from thumper.common.geometry import FloatArray
from thumper.gps.earth_reference import MapDatum
from thumper.maps.annotations import Annotations, annotations_path, save_annotations
from thumper.maps.map_server_io import save_map
from thumper.maps.plot import draw_grid, save_figure
from thumper.robot.figure import draw_drive
from thumper.runtime.drive_log import SPEED_COLUMNS, DriveLog, speed_errors
from thumper.runtime.drive_result import DriveResult
from thumper.slam.mapper import Mapper
from thumper.slam.saved_state import SavedSlamState, save_session

INK = "#1f2933"
LEGEND = {"loc": "lower center", "bbox_to_anchor": (0.56, 1.0), "ncols": 2, "frameon": False, "fontsize": 8}
"""Above the axes, between title and error; inside, it would cover the curves."""


def draw_speeds(figure: Figure, speeds: FloatArray, title: str) -> None:
    """Plot setpoint, measured speed and PWM of both sides over time."""
    axes = figure.subplots(3, 1, sharex=True, height_ratios=(2, 2, 1.2))
    time_s = speeds[:, 0] - speeds[0, 0]
    for panel, side in zip(axes, ("left", "right"), strict=False):
        setpoint = speeds[:, SPEED_COLUMNS.index(f"{side}_setpoint")]
        measured = speeds[:, SPEED_COLUMNS.index(f"{side}_speed")]
        error = speed_errors(speeds)[side]
        # Setpoint and speed of a row describe the interval before it; the PWM describes the one after it.
        panel.step(time_s, setpoint, where="pre", color=INK, linewidth=1.2, label="set-point")
        panel.plot(time_s, measured, ".-", color=BLUE, linewidth=1.0, markersize=3, label="measured")
        panel.set_ylabel(f"{side} [rad/s]")
        panel.set_title(
            f"error: mean {error.mean_rad_s:+.3f}, std {error.std_rad_s:.3f} rad/s", loc="right", fontsize=9
        )
        panel.legend(**LEGEND)
        panel.grid(alpha=0.3)
    axes[2].step(time_s, speeds[:, SPEED_COLUMNS.index("left_pwm")], where="post", color=BLUE, label="left")
    axes[2].step(
        time_s, speeds[:, SPEED_COLUMNS.index("right_pwm")], where="post", color=GREEN, label="right"
    )
    axes[2].set_ylabel("PWM [of 255]")
    axes[2].set_xlabel("time [s]")
    axes[2].legend(**LEGEND)
    axes[2].grid(alpha=0.3)
    axes[0].set_title(title, loc="left")


def write_run(
    folder: Path,
    mapper: Mapper,
    annotations: Annotations,
    log: DriveLog,
    result: DriveResult,
    datum: MapDatum | None = None,
) -> list[str]:
    """Write map, session, annotations, two pictures and summary.json of one run; return the file names."""
    grid = mapper.grid()
    save_map(grid, folder / "map.yaml", datum)
    save_session(SavedSlamState.from_mapper(mapper, result.pose), folder / "map.session")
    zones = save_annotations(annotations, annotations_path(folder / "map.yaml"))
    picture = Figure(figsize=(8, 7), layout="constrained")
    axes = picture.subplots()
    draw_grid(axes, grid)
    draw_drive(axes, log)
    for row, mark, colour, name in ((0, "o", GREEN, "start"), (-1, "s", BLUE, "end")):
        axes.plot(*log.poses[row:][:1, 1:3].T, mark, color=colour, markersize=8, label=name)
    axes.set_title(
        f"{result.path_length_m:.2f} m in {result.time_s:.1f} s: {result.reason}", fontsize=10, wrap=True
    )
    picture.legend(loc="outside lower center", ncols=4, fontsize=9)
    save_figure(picture, folder / "map.png", 130)
    speeds = log.speeds
    picture = Figure(figsize=(9, 6), layout="constrained")
    draw_speeds(picture, speeds, "wheel speed control")
    save_figure(picture, folder / "speed_control.png", 130)
    pose = result.pose
    summary = {
        "reached": result.reached,
        "interrupted": result.interrupted,
        "reason": result.reason,
        "time_s": round(result.time_s, 2),
        "path_length_m": round(result.path_length_m, 3),
        "pose": {"x_m": pose.x_m, "y_m": pose.y_m, "theta_rad": pose.theta_rad},
        "wheel_speed_error": {
            side: {"mean_rad_s": error.mean_rad_s, "std_rad_s": error.std_rad_s}
            for side, error in speed_errors(speeds).items()
        },
    }
    write_text(folder / "summary.json", json.dumps(summary, indent=2) + "\n")
    return ["map.pgm", "map.yaml", "map.session", *zones, "map.png", "speed_control.png", "summary.json"]
