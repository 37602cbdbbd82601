"""`thumper map-log`: a map and a trajectory from a recorded log."""

from pathlib import Path
from typing import Annotated

import typer


def map_log(
    file: Annotated[Path, typer.Argument(help="CARMEN log (.log, .clf) or MINES log (.dat), plain or .gz.")],
    out: Annotated[
        Path, typer.Option(help="Folder for map.pgm, map.yaml, map.png and trajectory.csv.")
    ] = Path("out/map-log"),
) -> None:
    """Build a map from a recorded lidar log, with the odometry and the mapper that the robot uses."""
    from rich.console import Console
    from rich.progress import Progress

    from thumper.cli.output import prepare_output
    from thumper.mapping.map_log import map_log as build

    prepare_output(out)
    console = Console()
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task(f"mapping {file.name}", total=None)
        summary = build(file, out, lambda done, total: progress.update(task, completed=done, total=total))
    console.print(summary)
    console.print(f"map, picture and trajectory are in {out}/")
