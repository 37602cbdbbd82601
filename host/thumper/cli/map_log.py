"""`thumper map-log`: build a map and a trajectory from a recorded log."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from thumper.cli.options.common import MapFolder, Session
from thumper.cli.output.interrupted import report_interrupt

if TYPE_CHECKING:
    from rich.console import Console

    from thumper.common.geometry import Pose2
    from thumper.offline.map_log import MapLogSummary

Method = Literal["slam", "scan_match", "rbpf"]
# The values of `thumper.slam.mounting.MountFinding`, which loads the mappers.
Mount = Literal[
    "as-is",
    "upside-down",
    "turned",
    "upside-down-turned",
    "mirrored",
    "mirrored-heading",
    "degrees",
    "millimetres",
]


@report_interrupt("the map was not finished")
def map_log(
    file: Annotated[
        Path,
        typer.Argument(
            help="CARMEN log (.log, .clf), MINES log (.dat) or ROS 2 recording (.mcap), plain or .gz."
        ),
    ],
    out: MapFolder = Path("out/map-log"),
    online: Annotated[
        bool,
        typer.Option(
            "--online",
            help="Write the poses known at each time to trajectory.csv, and the final ones to "
            "trajectory_final.csv.",
        ),
    ] = False,
    method: Annotated[
        Method,
        typer.Option(
            help="Mapper: scan matching with loop closure, scan matching alone, or particle filter."
        ),
    ] = "slam",
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Seed of the particle filter.")] = 1,
    fov: Annotated[
        float | None,
        typer.Option(
            min=1,
            max=360,
            help="Field of view of the lidar in degrees, for logs without it (FLASER, RLASER lines).",
        ),
    ] = None,
    mount: Annotated[
        Mount | None,
        typer.Option(
            metavar="<mount>",
            help="How to read the log. Of the lidar: upside-down, turned (by 180 degrees) or "
            "upside-down-turned. Of the odometry: mirrored (left and right swapped), mirrored-heading, "
            "degrees (its heading) or millimetres. Default: as-is, and checked.",
        ),
    ] = None,
    session: Session = None,
    start: Annotated[
        tuple[float, float, float] | None,
        typer.Option(
            metavar="X Y DEGREES",
            help="Start pose of the log in the --session: X and Y in metres, heading in degrees. Without it: "
            "global localization.",
        ),
    ] = None,
) -> None:
    """Build a map from a recorded lidar log with the robot's own odometry and mapper.

    Example: `thumper map-log intel.log --out out/intel`
    """
    from rich.console import Console
    from rich.progress import Progress

    from thumper.cli.output.folder import new_output
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.offline.map_log import LogReading
    from thumper.offline.map_log import map_log as build
    from thumper.slam.factory import MappingOptions
    from thumper.slam.mounting import MountFinding
    from thumper.slam.particle_filter.options import RbpfOptions
    from thumper.slam.saved_state import load_session

    if session is not None and method == "rbpf":
        raise ThumperError(
            "rbpf cannot continue a --session, only scan_match can; leave out --method", exit_code=EXIT_USAGE
        )
    start_pose = _start_pose(start, session)
    options = MappingOptions(method=method, filter=RbpfOptions(seed=seed))
    known = load_session(session, options.resolution_m) if session else None
    console = Console()
    # Without a terminal, the bar would leave an empty line.
    bar = Progress(console=console, transient=True, disable=not console.is_terminal)
    with new_output(out), bar as progress:
        task = progress.add_task(f"mapping {file.name}", total=None)
        summary = build(
            file,
            out,
            lambda done, total: progress.update(task, completed=done, total=total),
            options,
            online=online,
            session=known,
            start=start_pose,
            reading=LogReading(
                fov_rad=math.radians(fov) if fov else None, mounting=MountFinding(mount) if mount else None
            ),
        )
    _print_summary(summary, out, console)


def _start_pose(start: tuple[float, float, float] | None, session: Path | None) -> "Pose2 | None":
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.common.geometry import Pose2
    from thumper.navigation.goal import check_place

    if start is None:
        return None
    if session is None or not all(map(math.isfinite, start)):
        raise ThumperError(
            "--start X Y DEGREES must be finite numbers and needs --session", exit_code=EXIT_USAGE
        )
    check_place("--start", *start[:2])
    return Pose2(x_m=start[0], y_m=start[1], theta_rad=math.radians(start[2]))


def _print_summary(summary: "MapLogSummary", out: Path, console: "Console") -> None:
    import numpy as np

    matched = f"mean match {summary.mean_score:.2f} of 1"
    if math.isnan(summary.mean_score):
        matched = "no scan matched with a map"
    scans = "1 scan" if summary.scans == 1 else f"{summary.scans} scans"
    console.print(f"{summary.format_name} log: {scans}, {summary.path_m:.1f} m driven, {matched}")
    for note in summary.notes:
        console.print(f"note: {note}", markup=False, soft_wrap=True)
    console.print(f"in {out}/: {', '.join(path.name for path in summary.files)}", soft_wrap=True)
    memory = f", peak memory {summary.peak_MB:.0f} MB" if summary.peak_MB is not None else ""
    console.print(
        f"CPU per scan: mean {summary.cpu_ms.mean():.2f} ms, p99 {np.percentile(summary.cpu_ms, 99):.2f} ms; "
        f"{summary.wall_s:.1f} s in total{memory}",
        soft_wrap=True,
    )
