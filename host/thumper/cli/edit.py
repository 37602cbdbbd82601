"""`thumper edit`: rotate, crop and correct a saved map and its session."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from thumper.maps.edit import Box
    from thumper.maps.occupancy_grid import OccupancyGrid

BOX = "X0,Y0,X1,Y1 in metres after rotation"


def edit(
    file: Annotated[Path, typer.Argument(metavar="MAP.yaml", help="Saved map in map_server format.")],
    out: Annotated[Path, typer.Option(help="The new map's .yaml; its image and session go beside it.")],
    rotate: Annotated[
        float,
        typer.Option(
            help="Rotate counter-clockwise about the map's origin (0, 0), in degrees.", min=-360, max=360
        ),
    ] = 0.0,
    free: Annotated[list[str] | None, typer.Option(help=f"Make a box free: {BOX}; repeat for more.")] = None,
    wall: Annotated[
        list[str] | None, typer.Option(help=f"Make a box occupied: {BOX}; repeat for more.")
    ] = None,
    unknown: Annotated[
        list[str] | None, typer.Option(help=f"Make a box unknown: {BOX}; repeat for more.")
    ] = None,
    crop: Annotated[str, typer.Option(help=f"Crop to a box: {BOX}.")] = "",
    trim: Annotated[bool, typer.Option("--trim", help="Crop to the known area and 0.5 m around it.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite --out, even if it is MAP.yaml.")] = False,
) -> None:
    """Edit a saved map and save the result as a new map with its session.

    The steps run in this order: rotate, fill boxes (free, wall, unknown), crop. Unknown cells stay unknown. A
    map whose origin has a yaw is rotated so that the yaw becomes 0. `thumper run --session` can continue
    mapping in the result.

    Example: `thumper edit map.yaml --out new.yaml --rotate 90 --wall 1.0,-0.5,2.0,-0.45`
    """
    from thumper.cli.output.folder import prepare_output
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.maps.annotations import annotations_path, load_annotations
    from thumper.maps.map_server_io import load_rotated_map, map_yaml_path
    from thumper.slam.edited_map import save_edited_map

    edits = _Edits.parse(rotate=rotate, free=free, wall=wall, unknown=unknown, crop=crop, trim=trim)
    if out.is_dir():
        raise ThumperError(
            f"--out {out}: is a directory; name the new map, as in {out / 'map.yaml'}", exit_code=EXIT_USAGE
        )
    grid, yaw_rad = load_rotated_map(file)
    out = map_yaml_path(out)
    for path in (out, out.with_suffix(".pgm"), out.with_suffix(".session"), annotations_path(out)):
        if path.exists() and not force:
            raise ThumperError(
                f"{path} already exists; choose another --out or add --force", exit_code=EXIT_USAGE
            )
    done = [f"yaw of {math.degrees(yaw_rad):g} degrees removed"] if yaw_rad else []
    grid, log = edits.apply(grid)
    done += log
    if not done:
        raise ThumperError(
            "nothing to do: give --rotate, --free, --wall, --unknown, --crop or --trim", exit_code=EXIT_USAGE
        )
    annotations = load_annotations(annotations_path(file))
    prepare_output(out.parent)
    rotation_rad = math.radians(rotate)
    names = ", ".join(
        save_edited_map(file, out, grid, annotations.rotated(rotation_rad), rotation_rad=rotation_rad)
    )
    print(f"{file}: {', '.join(done)}; {_size_text(grid)}: {out}, {names}")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Fill:
    """Boxes that get one cell state, and the word for it in the summary."""

    word: str
    state: int
    boxes: "list[Box]"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Edits:
    """The requested edits, in the order in which they run."""

    rotate_deg: float
    fills: list[_Fill]
    crop: "Box | None"
    trim: bool

    @classmethod
    def parse(
        cls,
        *,
        rotate: float,
        free: Iterable[str] | None,
        wall: Iterable[str] | None,
        unknown: Iterable[str] | None,
        crop: str,
        trim: bool,
    ) -> "_Edits":
        """Check the options; raise `ThumperError` for an invalid one."""
        from thumper.common.errors import EXIT_USAGE, ThumperError
        from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN

        fills = [
            _Fill(word=word, state=state, boxes=[_box(f"--{option} {text}", text) for text in texts or ()])
            for option, word, state, texts in (
                ("free", "free", FREE, free),
                ("wall", "a wall", OCCUPIED, wall),
                ("unknown", "unknown", UNKNOWN, unknown),
            )
        ]
        box = _box(f"--crop {crop}", crop) if crop else None
        if not math.isfinite(rotate):
            raise ThumperError("--rotate must be a finite number of degrees", exit_code=EXIT_USAGE)
        if crop and trim:
            raise ThumperError(
                "--crop keeps a box, --trim the known area; give one of them", exit_code=EXIT_USAGE
            )
        return cls(rotate_deg=rotate, fills=fills, crop=box, trim=trim)

    def apply(self, grid: "OccupancyGrid") -> "tuple[OccupancyGrid, list[str]]":
        """Return the edited grid and what was done to it."""
        from thumper.maps import edit as map_edit

        done = []
        if self.rotate_deg:
            grid = map_edit.rotate(grid, math.radians(self.rotate_deg))
            done.append(f"rotated by {self.rotate_deg:g} degrees")
        for fill in self.fills:
            for box in fill.boxes:
                grid = map_edit.fill_box(grid, box, fill.state)
            if fill.boxes:
                count = len(fill.boxes)
                done.append(f"{count} {'box' if count == 1 else 'boxes'} made {fill.word}")
        if self.crop:
            return map_edit.crop(grid, self.crop), [*done, "cropped"]
        if self.trim:
            return map_edit.trim(grid), [*done, "trimmed"]
        return grid, done


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


def _size_text(grid: "OccupancyGrid") -> str:
    from thumper.common.texts import place_text
    from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN

    rows, cols = grid.cells.shape
    count = {state: int((grid.cells == state).sum()) for state in (FREE, OCCUPIED, UNKNOWN)}
    return (
        f"now {cols} x {rows} cells of {grid.resolution_m:g} m from "
        f"{place_text(grid.origin_x_m, grid.origin_y_m)}, {count[FREE]} free, {count[OCCUPIED]} occupied, "
        f"{count[UNKNOWN]} unknown"
    )
