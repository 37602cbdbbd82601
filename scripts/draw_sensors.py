"""Draw the picture of docs/explanation/sensors.md into docs/images/.

Run: python scripts/draw_sensors.py (half a minute)
"""

import sys
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.shared.gyro_heading import heading_errors

from thumper.common.colours import BLUE, RED
from thumper.maps.plot import save_figure

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
DPI = 148  # large text: the README shows the picture at half its width
SEEDS = (1, 2, 3)


def draw_heading(path: Path) -> None:
    """Draw the heading's error over three drives, by the wheels alone and with a BNO08x."""
    figure = Figure(figsize=(5.0, 2.3), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)  # draws without a display
    axes = figure.subplots()
    for seed in SEEDS:
        time_s, fused_rad, wheels_rad = heading_errors(f"picture-{seed}", "bno08x", seed).T
        first = seed == SEEDS[0]
        axes.plot(time_s, wheels_rad, color=RED, label="wheels alone" if first else None)
        axes.plot(time_s, fused_rad, color=BLUE, label="with a gyroscope" if first else None)
    axes.set(xlabel="time [s]", ylabel="heading error [rad]", xlim=(0.0, time_s[-1]))
    axes.legend(loc="upper left", frameon=False)
    save_figure(figure, path, DPI)


if __name__ == "__main__":
    draw_heading(IMAGES / "gyroscope_heading.png")
