"""The pictures of a run: legends and texts do not cover the curves, and name them correctly."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from thumper.cli.output.run_report import draw_speeds
from thumper.common.geometry import Pose2
from thumper.robot.figure import draw_drive
from thumper.runtime.drive_log import DriveLog


def test_legends_do_not_cover_the_curves() -> None:
    figure = Figure(figsize=(9, 6), layout="constrained")
    speeds = np.zeros((20, 8))
    speeds[:, 0] = np.arange(20)
    draw_speeds(figure, speeds, "wheel speed control on the straight run")
    FigureCanvasAgg(figure).draw()  # type: ignore[no-untyped-call]
    for panel in figure.axes:
        legend = panel.get_legend()
        assert legend is not None
        box, own = legend.get_window_extent(), legend.findobj(Text)
        assert not box.overlaps(panel.get_window_extent())
        for text in panel.findobj(Text):
            if text not in own and isinstance(text, Text) and text.get_text():
                assert not box.overlaps(text.get_window_extent()), text


def test_the_first_plan_is_the_first_one_with_a_length() -> None:
    """Exploration starts with a goal at the current position, whose plan has no length."""
    log = DriveLog()
    log.add_pose(0.0, Pose2())
    empty, path = np.zeros((2, 2)), np.array([[0.0, 0.0], [1.0, 0.0]])
    for plan in (empty, path, path + 0.1):
        log.add_plan(plan)
    axes = Figure().subplots()
    draw_drive(axes, log)
    (dashed,) = (line for line in axes.lines if line.get_linestyle() == "--")
    assert np.array_equal(np.asarray(dashed.get_xydata()), path)
    assert "planned at the start" in str(dashed.get_label())
