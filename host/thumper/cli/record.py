"""`thumper record`: record a robot that runs, from beside it or from another machine."""

from pathlib import Path
from typing import Annotated

import typer

from thumper.cli.bus_options import Address, Config, Robot, join


def record(
    out: Annotated[
        Path | None, typer.Option(help="Folder for the recordings; without it, as configured.")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(help="Record for so long; without it, until Ctrl-C.", min=0.1)
    ] = None,
    config: Config = None,
    bus: Address = "",
    robot: Robot = "",
) -> None:
    """Record everything that a running robot says, in MCAP files.

    `thumper run --record` does the same inside the robot's program, and loses nothing to the network.
    """
    import sys

    from thumper.cli.output_folder import prepare_output
    from thumper.common.errors import ThumperError
    from thumper.config.robot import load_config
    from thumper.recording.bus_recorder import record_from_bus
    from thumper.recording.repair import recover_apart

    settings = load_config(config)
    folder = out or Path(settings.recording.folder)

    def say(text: str) -> None:
        print(f"thumper: {text}", file=sys.stderr)

    with join(config, bus, robot) as client:
        prepare_output(folder)
        recover_apart(folder)
        print(f"recording to {folder}/; Ctrl-C ends it")
        recorder = record_from_bus(client, folder, settings.recording, seconds=seconds, say=say)
    if recorder.trouble:
        raise ThumperError(f"the recording ended early: {recorder.trouble}")
    dropped = f", {recorder.dropped} dropped: the disk is too slow" if recorder.dropped else ""
    print(f"{recorder.written} messages{dropped}: {recorder.files[-1]}")
