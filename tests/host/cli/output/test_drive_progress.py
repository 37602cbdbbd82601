"""Without a terminal, a drive prints a line every few seconds; it says why the robot turns."""

from io import StringIO

import pytest
from rich.console import Console

from thumper.cli.output.drive_progress import ProgressDisplay
from thumper.cli.output.status_line import PLAIN_PERIOD_S
from thumper.navigation.goal import Goal
from thumper.runtime.drive.legs import Leg
from thumper.runtime.drive_result import DriveProgress


def test_plain_lines(capsys: pytest.CaptureFixture[str]) -> None:
    display = ProgressDisplay(Console(file=StringIO()))
    display.started(Leg(goal=Goal(x_m=1.0, y_m=0.0), name="to the box"))
    for time_s, remark in ((0.1, ""), (1.0, "too soon"), (0.1 + PLAIN_PERIOD_S, "turning in place")):
        display.progress(DriveProgress(time_s=time_s, distance_to_goal_m=1.5, remark=remark))
    assert capsys.readouterr().out.splitlines() == [
        "to the box: 1.50 m to go, 0.1 s",
        "to the box: 1.50 m to go, 5.1 s; turning in place",
    ]


def test_a_long_remark_is_cut_and_the_distance_stays() -> None:
    terminal = StringIO()
    display = ProgressDisplay(Console(file=terminal, force_terminal=True, width=80))
    display.started(Leg(goal=Goal(x_m=1.0, y_m=0.0), name="around a paper box"))
    display.progress(DriveProgress(time_s=1.0, distance_to_goal_m=1.5, remark=80 * "x"))
    display.ended(None)
    assert "1.50 m to go, 1.0 s; xxx" in terminal.getvalue()
    assert "around a paper box" in terminal.getvalue()
