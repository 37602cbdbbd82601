"""`thumper plan`: plan paths on a saved map."""

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from thumper.cli.options.common import AsJson, ConfigFile

if TYPE_CHECKING:
    from thumper.cli.plan_queries import PlanAnswer
    from thumper.maps.occupancy_grid import OccupancyGrid
    from thumper.navigation.costmap.filters import Masks
    from thumper.navigation.options import NavigationOptions


def _planners() -> list[str]:
    from thumper.navigation.registry import PLANNERS  # slow

    return list(PLANNERS)


def plan(
    file: Annotated[Path, typer.Argument(metavar="MAP.yaml", help="Saved map in map_server format.")],
    start: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="X Y", help="Start in the map, in metres; required without --batch."),
    ] = None,
    goal: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="X Y", help="Goal in the map, in metres; required without --batch."),
    ] = None,
    planner: Annotated[
        str,
        typer.Option(
            help="carrot, navfn, astar or lattice; overrides the configuration.",
            autocompletion=_planners,
        ),
    ] = "",
    unknown: Annotated[
        bool | None,
        typer.Option("--unknown/--no-unknown", help="Allow paths through unknown space, or forbid them."),
    ] = None,
    tolerance: Annotated[
        float, typer.Option(help="Allowed distance from the goal, in metres.", min=1e-6, max=1.0)
    ] = 0.1,
    start_heading: Annotated[
        float, typer.Option(help="Heading at the start, in degrees from the x axis.")
    ] = 0.0,
    keepout: Annotated[
        Path | None, typer.Option(help="Keep-out mask (.yaml); overrides the configuration.")
    ] = None,
    speed_mask: Annotated[
        Path | None, typer.Option(help="Speed mask (.yaml); overrides the configuration.")
    ] = None,
    batch: Annotated[
        Path | None, typer.Option(help="CSV file with columns start_x, start_y, goal_x, goal_y.")
    ] = None,
    config: ConfigFile = None,
    as_json: AsJson = False,
    png: Annotated[Path | None, typer.Option(help="Draw map and path to this file.")] = None,
) -> None:
    """Plan a path on a saved map; print its length and the time to drive it.

    The time assumes the fastest speed that the robot and the speed mask allow. With --batch, the output has
    one CSV line (or JSON object) per row: found, length, planning time in milliseconds, reason. Exits with 1
    if there is no path.

    Example: `thumper plan map.yaml --start 0 0 --goal 2.0 0.5 --png path.png`
    """
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.maps.map_server_io import load_map

    grid = load_map(file)  # before the options: a mistyped file is the nearer mistake
    missing = [name for name, at in (("--start X Y", start), ("--goal X Y", goal)) if at is None]
    if batch is None and missing:
        raise ThumperError(f"pass also {' and '.join(missing)}, or --batch FILE.csv", exit_code=EXIT_USAGE)
    if batch is not None and (start is not None or goal is not None or png is not None):
        raise ThumperError(
            "--batch has its own starts and goals: leave out --start, --goal and --png", exit_code=EXIT_USAGE
        )
    if png is not None and png.suffix.lower() != ".png":
        raise ThumperError(f"--png {png}: the name of a picture ends in .png", exit_code=EXIT_USAGE)
    from thumper.cli.plan_queries import PlanQuery, QueryPlanner, read_queries, to_csv  # slow: kernels
    from thumper.config.robot import load_config
    from thumper.maps.annotations import annotations_path, load_annotations
    from thumper.navigation.costmap.zones import zone_masks

    settings = load_config(config)
    options = _options(settings.navigation, planner, unknown, {"keepout": keepout, "speed": speed_mask})
    zones = zone_masks(load_annotations(annotations_path(file)).zones)
    queries = read_queries(batch, grid) if batch else []
    if start and goal:
        queries = [PlanQuery(start_m=start, goal_m=goal)]
    query_planner = QueryPlanner(grid, settings, options, zones)
    if options.planner != "carrot":  # load the kernels first, so that they do not count as planning time
        query_planner.answer(queries[0], tolerance_m=tolerance, heading_deg=start_heading)
    answers = [
        query_planner.answer(query, tolerance_m=tolerance, heading_deg=start_heading) for query in queries
    ]
    if batch is not None:
        typer.echo(
            json.dumps([answer.to_json() for answer in answers], indent=1) if as_json else to_csv(answers)
        )
    else:
        typer.echo(_json(options.planner, answers[0]) if as_json else _text(answers[0]))
        if png is not None:
            _draw(grid, query_planner.keepout, answers[0], png, f"{file.name}: {options.planner}")
            if not as_json:
                typer.echo(f"map and path are in {png}")
    if not all(answer.found for answer in answers):
        raise typer.Exit(1)


def _options(
    options: "NavigationOptions", planner: str, unknown: bool | None, masks: dict[str, Path | None]
) -> "NavigationOptions":
    """Return the configured options with those of the command line on top."""
    if planner:
        options = dataclasses.replace(options, planner=planner)
    if unknown is not None:
        traversal = dataclasses.replace(options.traversal, allow_unknown=unknown)
        options = dataclasses.replace(options, traversal=traversal)
    files = {name: str(path) for name, path in masks.items() if path}
    return dataclasses.replace(options, masks=dataclasses.replace(options.masks, **files))


def _json(planner: str, answer: "PlanAnswer") -> str:
    from thumper.cli.plan_queries import DECIMALS

    path = [] if answer.path_m is None else answer.path_m.round(DECIMALS).tolist()
    return json.dumps({"planner": planner, **answer.to_json(), "path": path})


def _text(answer: "PlanAnswer") -> str:
    if answer.path_m is None:
        return f"no path: {answer.reason}"
    note = f"; {answer.reason}" if answer.reason else ""
    if answer.unknown_m:
        note = f"; {answer.unknown_m:.1f} m of it through unknown space{note}"
    return (
        f"{answer.length_m:.3f} m in {len(answer.path_m)} points, {answer.travel_s:.1f} s at full speed, "
        f"planned in {answer.time_ms:.2f} ms{note}"
    )


def _draw(grid: "OccupancyGrid", keepout: "Masks", answer: "PlanAnswer", png: Path, title: str) -> None:
    """Draw map, keep-out zones and path."""
    import numpy as np

    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.maps.plot import plot_map
    from thumper.navigation.costmap.filters import keepout_cells

    path_m = np.empty((0, 2)) if answer.path_m is None else answer.path_m
    try:
        plot_map(grid, path_m, png, title, planned=True, keepout=keepout_cells(keepout, grid))
    except (OSError, ValueError) as error:
        raise ThumperError(
            f"{png}: cannot be written ({error}); choose another file with --png", exit_code=EXIT_USAGE
        ) from error
