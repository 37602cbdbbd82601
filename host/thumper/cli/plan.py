"""`thumper plan`: the way from here to there on a saved map."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from thumper.cli.plan_queries import PlanQuery
    from thumper.common.geometry import FloatArray
    from thumper.maps.occupancy_grid import OccupancyGrid
    from thumper.navigation.costmap.costmap import Costmap
    from thumper.navigation.planners.planner import Planner

    Answer = dict[str, object]

DECIMALS = 4
KEEP_OUT_SHADE = 40  # percent of occupancy, as which a keep-out zone is drawn


def plan(
    file: Annotated[Path, typer.Argument(metavar="MAP.yaml", help="The map, as map_server saves it.")],
    start: Annotated[tuple[float, float] | None, typer.Option(help="X Y in metres, in the map.")] = None,
    goal: Annotated[tuple[float, float] | None, typer.Option(help="X Y in metres, in the map.")] = None,
    planner: Annotated[str, typer.Option(help="carrot, navfn, astar or lattice; else the robot's.")] = "",
    unknown: Annotated[
        bool | None, typer.Option("--unknown/--no-unknown", help="Cross ground never seen, or do not.")
    ] = None,
    tolerance: Annotated[
        float, typer.Option(help="How near to the goal is near enough [m].", min=1e-6, max=1.0)
    ] = 0.1,
    heading: Annotated[float, typer.Option(help="The robot's heading at the start [degrees].")] = 0.0,
    keepout: Annotated[
        Path | None, typer.Option(help="YAML of a keep-out mask; overrides the robot's.")
    ] = None,
    speed_mask: Annotated[
        Path | None, typer.Option(help="YAML of a speed mask; overrides the robot's.")
    ] = None,
    batch: Annotated[Path | None, typer.Option(help="CSV of start_x, start_y, goal_x, goal_y.")] = None,
    config: Annotated[Path | None, typer.Option(help="The robot's TOML; without it, a Wild Thumper.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON with the path.")] = False,
    png: Annotated[Path | None, typer.Option(help="Draw map and path to this file.")] = None,
) -> None:
    """Plan a path and print its length; leaves with 1 when there is no way.

    The time is that of driving it at the fastest speed that the robot and the speed mask allow.
    With --batch one line of CSV (or one JSON object) a row: found, length, milliseconds, reason.
    """
    import dataclasses
    import json

    import numpy as np

    from thumper.cli.plan_queries import PlanQuery, read_queries
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.config.robot import load_config
    from thumper.maps.map_server_io import load_map
    from thumper.navigation.controllers.speed_limiter import SpeedLimiter
    from thumper.navigation.costmap.costmap import build_costmap
    from thumper.navigation.costmap.filters import is_closed, load_masks
    from thumper.navigation.costmap.footprint_collision import category_at
    from thumper.navigation.registry import make_planner

    if batch is None and (start is None or goal is None):
        raise ThumperError(
            "nothing to plan: give --start X Y and --goal X Y, or --batch FILE.csv", exit_code=EXIT_USAGE
        )
    if batch is not None and (start is not None or goal is not None or png is not None):
        raise ThumperError(
            "--batch brings its own starts and goals: leave --start, --goal and --png", exit_code=EXIT_USAGE
        )
    settings = load_config(config)
    options = settings.navigation
    if planner:
        options = dataclasses.replace(options, planner=planner)
    if unknown is not None:
        names = ("navfn", "astar", "lattice")
        changed = {n: dataclasses.replace(getattr(options, n), allow_unknown=unknown) for n in names}
        options = dataclasses.replace(options, **changed)
    given = {"keepout": keepout, "speed": speed_mask}
    masks = load_masks(
        dataclasses.replace(options.masks, **{name: str(path) for name, path in given.items() if path})
    )
    chosen = make_planner(options, settings.footprint)
    rule = SpeedLimiter(options.limits, approach_m_s=options.approach_m_s, mask=masks.speed)
    grid = load_map(file)
    costmap = build_costmap(grid, np.empty((0, 2)), settings.footprint, options.costmap, masks.keepout)
    if batch is not None:
        queries = read_queries(batch, grid)
    else:
        assert start is not None  # checked above
        assert goal is not None
        queries = [PlanQuery(start_m=start, goal_m=goal)]
    if options.planner != "carrot":
        _answer(
            chosen, costmap, queries[0], tolerance, heading
        )  # loads the kernels, so that times are honest
    answers, paths = [], []
    for query in queries:
        answer, path_m = _answer(chosen, costmap, query, tolerance, heading)
        answer["travel_s"] = None if path_m is None else round(rule.travel_s(path_m), DECIMALS)
        for end, (x_m, y_m) in (("start", query.start_m), ("goal", query.goal_m)):
            category = category_at(costmap, settings.footprint, x_m, y_m)
            answer[f"{end}_category"] = "off the map" if category is None else category.value
        answers.append(answer)
        paths.append(path_m)
    if batch is not None:
        typer.echo(json.dumps(answers, indent=1) if as_json else _csv(answers))
    else:
        points = [] if paths[0] is None else paths[0].round(DECIMALS).tolist()
        if as_json:
            typer.echo(json.dumps({"planner": options.planner, **answers[0], "path": points}))
        else:
            typer.echo(_words(answers[0], len(points)))
        if png is not None:
            closed = is_closed(masks.keepout, grid) & (grid.cells < KEEP_OUT_SHADE)
            grid = dataclasses.replace(
                grid, cells=np.where(closed, KEEP_OUT_SHADE, grid.cells).astype(np.int8)
            )
            _draw(grid, paths[0], png, f"{file.name}: {options.planner}")
    if not all(answer["found"] for answer in answers):
        raise typer.Exit(1)


def _answer(
    planner: "Planner", costmap: "Costmap", query: "PlanQuery", tolerance_m: float, heading_deg: float
) -> "tuple[Answer, FloatArray | None]":
    """What one question comes to, and its path."""
    import math

    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.common.geometry import Pose2
    from thumper.navigation.goal import Goal, check_place
    from thumper.navigation.planners.polyline import arc_lengths

    numbers = (*query.start_m, *query.goal_m, heading_deg, tolerance_m)
    if not all(map(math.isfinite, numbers)):
        raise ThumperError("start, goal, heading and tolerance must be finite numbers", exit_code=EXIT_USAGE)
    check_place("the start", *query.start_m)
    check_place("the goal", *query.goal_m)
    start = Pose2(x_m=query.start_m[0], y_m=query.start_m[1], theta_rad=math.radians(heading_deg))
    goal = Goal(x_m=query.goal_m[0], y_m=query.goal_m[1], tolerance_m=tolerance_m)
    begun = time.perf_counter()
    result = planner.plan(costmap, start, goal)
    took_ms = 1e3 * (time.perf_counter() - begun)
    length_m = None if result.path_m is None else round(float(arc_lengths(result.path_m)[-1]), DECIMALS)
    answer: Answer = {
        "start": [round(number, DECIMALS) for number in query.start_m],
        "goal": [round(number, DECIMALS) for number in query.goal_m],
        "found": result.path_m is not None,
        "length_m": length_m,
        "time_ms": round(took_ms, 3),
        "reason": result.reason,
    }
    return answer, result.path_m


def _words(answer: "Answer", points: int) -> str:
    told = f"; {answer['reason']}" if answer["found"] and answer["reason"] else ""
    if not answer["found"]:
        return f"no path: {answer['reason']}"
    return (
        f"{answer['length_m']:.3f} m in {points} points, {answer['travel_s']:.1f} s at the fastest, "
        f"planned in {answer['time_ms']:.2f} ms{told}"
    )


def _csv(answers: "list[Answer]") -> str:
    import csv
    import io

    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("start_x", "start_y", "goal_x", "goal_y", "found", "length_m", "time_ms", "reason"))
    for answer in answers:
        start, goal = answer["start"], answer["goal"]
        assert isinstance(start, list)
        assert isinstance(goal, list)
        rest = (int(bool(answer["found"])), answer["length_m"], answer["time_ms"], answer["reason"])
        writer.writerow((*start, *goal, *rest))
    return text.getvalue().rstrip("\n")


def _draw(grid: "OccupancyGrid", path_m: "FloatArray | None", png: Path, title: str) -> None:
    import numpy as np

    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.maps.plot import plot_map

    try:
        plot_map(grid, np.empty((0, 2)) if path_m is None else path_m, png, title)
    except (OSError, ValueError) as error:
        raise ThumperError(
            f"{png}: cannot be written ({error}); choose another file with --png", exit_code=EXIT_USAGE
        ) from error
