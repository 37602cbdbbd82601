"""`thumper edit`: turn a saved map, crop it, make parts of it free, a wall or unknown, its session too."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from thumper.common.geometry import Pose2
    from thumper.maps.edit import Box
    from thumper.maps.occupancy_grid import OccupancyGrid

BOX = "X0,Y0,X1,Y1 in metres, in the map once turned"


def edit(
    file: Annotated[Path, typer.Argument(metavar="MAP.yaml", help="The map, as map_server saves it.")],
    out: Annotated[Path, typer.Option(help="The new map's .yaml; its image and session are put beside it.")],
    rotate: Annotated[
        float,
        typer.Option(
            help="Turn it counter-clockwise about its origin (0, 0), by so many degrees.", min=-360, max=360
        ),
    ] = 0.0,
    free: Annotated[
        list[str] | None, typer.Option(help=f"Make a box free: {BOX}; may be given often.")
    ] = None,
    wall: Annotated[
        list[str] | None, typer.Option(help=f"Make a box occupied: {BOX}; may be given often.")
    ] = None,
    unknown: Annotated[
        list[str] | None, typer.Option(help=f"Make a box unknown: {BOX}; may be given often.")
    ] = None,
    crop: Annotated[str, typer.Option(help=f"Keep this box alone: {BOX}.")] = "",
    trim: Annotated[bool, typer.Option("--trim", help="Keep what is known, and 0.5 m round it.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite --out, even if it is MAP.yaml.")] = False,
) -> None:
    """Change a saved map and save it as another one; what is unknown stays unknown.

    First it is turned, then boxes are filled (free, wall, unknown), then it is cropped. A map whose origin
    has a yaw is turned so that it has none. The new map's session is made from it, to go on mapping in.
    """
    from thumper.cli.output_folder import prepare_output
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.maps import edit as map_edit
    from thumper.maps.hit_counts import HitCounts
    from thumper.maps.map_server_io import load_rotated_map, map_yaml_path, save_map
    from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN
    from thumper.slam.saved_state import SavedSlamState, save_session

    boxes = [
        (word, state, [_box(f"--{option} {text}", text) for text in given or []])
        for option, word, state, given in (
            ("free", "free", FREE, free),
            ("wall", "a wall", OCCUPIED, wall),
            ("unknown", "unknown", UNKNOWN, unknown),
        )
    ]
    kept = _box(f"--crop {crop}", crop) if crop else None
    if not math.isfinite(rotate):
        raise ThumperError("--rotate takes a finite number of degrees", exit_code=EXIT_USAGE)
    if crop and trim:
        raise ThumperError("--crop keeps a box, --trim what is known: give one", exit_code=EXIT_USAGE)
    if out.is_dir():
        raise ThumperError(
            f"--out {out}: this is a folder; name the new map, as in {out / 'map.yaml'}", exit_code=EXIT_USAGE
        )
    grid, yaw_rad = load_rotated_map(file)
    out = map_yaml_path(out)
    for path in (out, out.with_suffix(".pgm"), out.with_suffix(".session")):
        if path.exists() and not force:
            raise ThumperError(
                f"{path} is there already; give another --out, or --force", exit_code=EXIT_USAGE
            )
    done = [f"its yaw of {math.degrees(yaw_rad):g} degrees taken out"] if yaw_rad else []
    if rotate:
        grid = map_edit.rotate(grid, math.radians(rotate))
        done.append(f"turned by {rotate:g} degrees")
    for word, state, several in boxes:
        for one in several:
            grid = map_edit.fill_box(grid, one, state)
        if several:
            done.append(f"{len(several)} {'box' if len(several) == 1 else 'boxes'} made {word}")
    if kept or trim:
        grid = map_edit.crop(grid, kept) if kept else map_edit.trim(grid)
        done.append("cropped" if kept else "trimmed")
    if not done:
        raise ThumperError(
            "nothing to do: give --rotate, --free, --wall, --unknown, --crop or --trim", exit_code=EXIT_USAGE
        )
    prepare_output(out.parent)
    pose = _saved_pose(file, grid.resolution_m, math.radians(rotate))
    image = save_map(grid, out)
    session = save_session(
        SavedSlamState(counts=HitCounts.from_grid(grid), map_from_base=pose), out.with_suffix(".session")
    )
    print(f"{file}: {', '.join(done)}; {_words(grid)}: {out}, {image.name} and {session.name}")


def _saved_pose(file: Path, resolution_m: float, turn_rad: float) -> "Pose2 | None":
    """Where the session beside the map says that the robot was, in the map once turned."""
    from thumper.common.errors import ThumperError
    from thumper.common.geometry import Pose2
    from thumper.slam.saved_state import load_session

    try:
        pose = load_session(file.with_suffix(".session"), resolution_m).map_from_base
    except ThumperError:  # there is none, or none that is of use
        return None
    return Pose2(theta_rad=turn_rad) @ pose if pose else None


def _box(option: str, text: str) -> "Box":
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.maps.edit import Box

    try:
        x0_m, y0_m, x1_m, y1_m = map(float, text.split(","))
        if not all(map(math.isfinite, (x0_m, y0_m, x1_m, y1_m))):
            raise ValueError(text)
    except ValueError as error:
        raise ThumperError(
            f"{option}: give X0,Y0,X1,Y1 in metres, as in 1.0,-0.5,2,0", exit_code=EXIT_USAGE
        ) from error
    return Box(x0_m=x0_m, y0_m=y0_m, x1_m=x1_m, y1_m=y1_m)


def _words(grid: "OccupancyGrid") -> str:
    from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN

    rows, cols = grid.cells.shape
    count = {state: int((grid.cells == state).sum()) for state in (FREE, OCCUPIED, UNKNOWN)}
    return (
        f"now {cols} x {rows} cells of {grid.resolution_m:g} m from ({grid.origin_x_m:.2f}, "
        f"{grid.origin_y_m:.2f}), {count[FREE]} free, {count[OCCUPIED]} occupied, {count[UNKNOWN]} unknown"
    )
