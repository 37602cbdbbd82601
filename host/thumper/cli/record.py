"""`thumper record`: record a running robot, on its own computer or another one."""

from pathlib import Path
from typing import Annotated

import typer

from thumper.cli.options.bus import connect
from thumper.cli.options.common import BusAddress, ConfigFile, RobotName
from thumper.cli.output.recording_summary import recording_failure, recording_summary
from thumper.cli.output.stderr_report import report_to_stderr


def record(
    out: Annotated[
        Path | None, typer.Option(help="Folder for the recordings; overrides the configuration.")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(help="Stop after this many seconds; without it, at Ctrl-C.", min=0.1)
    ] = None,
    config: ConfigFile = None,
    bus: BusAddress = "",
    robot: RobotName = "",
) -> None:
    """Record all messages of a running robot to MCAP files.

    `thumper run --record` does the same in the robot's own process and loses nothing to the network. If the
    robot restarts, its new run becomes a new recording.

    Example: `thumper record --seconds 60`
    """
    from thumper.cli.output.folder import prepare_output
    from thumper.common.errors import ThumperError
    from thumper.config.robot import load_config
    from thumper.recording.bus_recorder import record_from_bus
    from thumper.recording.repair import repair_in_subprocess

    settings = load_config(config)
    folder = out or Path(settings.recording.folder)

    with connect(config, bus, robot) as client:
        prepare_output(folder)
        repair_in_subprocess(folder)
        print(f"recording to {folder}/ (Ctrl-C to stop)")
        recorders = record_from_bus(
            client, folder, settings.recording, seconds=seconds, report=report_to_stderr
        )
    for recorder in recorders:
        print(recording_summary(recorder))
    if failure := recording_failure(recorders[-1]):
        raise ThumperError(failure)
