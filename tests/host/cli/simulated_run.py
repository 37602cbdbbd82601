"""The options of a run of the simulated robot, for tests that change some."""

from pathlib import Path

from thumper.cli.robot_run import RunOptions


def simulated_run(out: Path) -> RunOptions:
    """Return the options of a run that writes to `out`."""
    return RunOptions(
        config=None,
        board="sim://",
        lidar="",
        bus="",
        start=None,
        session=None,
        out=out,
        record=False,
        record_to=None,
    )
