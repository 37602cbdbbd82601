"""`thumper map-log`: a map and a trajectory from a recorded log."""

import math
from pathlib import Path
from typing import Annotated, Literal

import typer

from thumper.cli.interrupted import interrupt_told

Method = Literal["graph", "rbpf", "scan_match"]


@interrupt_told("the map was not finished")
def map_log(
    file: Annotated[
        Path,
        typer.Argument(
            help="CARMEN log (.log, .clf), MINES log (.dat) or ROS 2 recording (.mcap), plain or .gz."
        ),
    ],
    out: Annotated[
        Path, typer.Option(help="Folder for map.pgm, map.yaml, map.session, map.png and trajectory.csv.")
    ] = Path("out/map-log"),
    online: Annotated[
        bool,
        typer.Option(
            help="Poses as reported at the time in trajectory.csv, the final path in trajectory_final.csv."
        ),
    ] = False,
    method: Annotated[
        Method | None,
        typer.Option(
            help="Mapper: pose graph, particle filter or plain scan matching; without it graph, or "
            "scan_match with --session."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Seed of the particle filter.")] = 1,
    fov: Annotated[
        float | None,
        typer.Option(
            min=1,
            max=360,
            help="The laser's field of view in degrees, for logs that lack it: FLASER, RLASER lines.",
        ),
    ] = None,
    session: Annotated[
        Path | None, typer.Option(help="Go on mapping in this map.session, from a robot or another log.")
    ] = None,
    start: Annotated[
        tuple[float, float, float] | None,
        typer.Option(
            help="Where the log begins in the --session: X Y in metres, then the heading in degrees. Without "
            "it, wherever the place is recognised."
        ),
    ] = None,
) -> None:
    """Build a map from a recorded lidar log, with the odometry and the mapper that the robot uses."""
    import numpy as np
    from rich.console import Console
    from rich.progress import Progress

    from thumper.cli.output_folder import prepare_output
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.common.geometry import Pose2
    from thumper.navigation.goal import check_place
    from thumper.offline.map_log import map_log as build
    from thumper.slam.factory import MappingOptions
    from thumper.slam.particle_filter.rbpf_mapper import RbpfOptions
    from thumper.slam.saved_state import load_session

    if session is not None and method not in (None, "scan_match"):
        raise ThumperError(
            f"--session is gone on with by scan_match, not by {method}: leave out --method",
            exit_code=EXIT_USAGE,
        )
    if start is not None and (session is None or not all(map(math.isfinite, start))):
        raise ThumperError(
            "--start X Y DEGREES belongs to --session, and takes finite numbers", exit_code=EXIT_USAGE
        )
    if start is not None:
        check_place("--start", *start[:2])
    begin = Pose2(x_m=start[0], y_m=start[1], theta_rad=math.radians(start[2])) if start else None
    options = MappingOptions(method="graph" if method is None else method, filter=RbpfOptions(seed=seed))
    known = load_session(session, options.resolution_m) if session else None
    prepare_output(out)
    console = Console()
    # Without a terminal the bar would leave an empty line.
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(f"mapping {file.name}", total=None)
        summary = build(
            file,
            out,
            lambda done, total: progress.update(task, completed=done, total=total),
            options,
            online=online,
            fov_rad=math.radians(fov) if fov else None,
            session=known,
            start=begin,
        )
    matched = f"mean match {summary.mean_score:.2f} of 1"
    if math.isnan(summary.mean_score):
        matched = "no scan matched with a map"
    scans = "1 scan" if summary.scans == 1 else f"{summary.scans} scans"
    console.print(f"{summary.format_name} log: {scans}, {summary.path_m:.1f} m driven, {matched}")
    for note in summary.notes:
        console.print(f"note: {note}", markup=False, soft_wrap=True)
    console.print(f"in {out}/: {', '.join(path.name for path in summary.files)}", soft_wrap=True)
    memory = f", {summary.peak_MB:.0f} MB of memory at most" if summary.peak_MB is not None else ""
    console.print(
        f"CPU a scan: mean {summary.cpu_ms.mean():.2f} ms, p99 {np.percentile(summary.cpu_ms, 99):.2f} ms; "
        f"{summary.wall_s:.1f} s in all{memory}",
        soft_wrap=True,
    )
