"""Maps on disk: the PGM image and YAML description that ROS's map_server reads and writes.

Format: http://wiki.ros.org/map_server, "trinary" mode. The description is six keys on six lines, so it is
written and read by hand: no YAML library is needed.
"""

import math
import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.maps.edit import rotate
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from thumper.maps.pgm import decode_pgm, encode_pgm

FREE_THRESH, OCCUPIED_THRESH = 0.196, 0.65
WHITE_FREE, BLACK_OCCUPIED, GREY_UNKNOWN = 254, 0, 205
# 0.196 is 50/255: grey 205 is exactly on it, so the comparison below must be strict for unknown to survive.

ImageArray = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class Description:
    """What the YAML file says of its image; `mode` is trinary, scale or raw."""

    image: str
    mode: str
    resolution_m: float
    origin_x_m: float
    origin_y_m: float
    yaw_rad: float
    negate: bool
    occupied_thresh: float
    free_thresh: float


def map_yaml_path(name: str | Path) -> Path:
    """Where the description of a map called `name` is: any ending but .yaml is a part of the name."""
    return Path(f"{str(name).removesuffix('.yaml')}.yaml")


def save_map(grid: OccupancyGrid, yaml_path: Path) -> Path:
    """Write `yaml_path` and, beside it, the image of the same name with `.pgm`; return the image's path.

    Each file appears whole or not at all, the image first. Cells of 65 % and more become occupied, cells
    below 19.6 % free, the rest unknown.

    Raises
    ------
    ThumperError
        The folder cannot be written.
    """
    pgm_path = yaml_path.with_suffix(".pgm")
    occupied = grid.cells >= 100.0 * OCCUPIED_THRESH
    free = (grid.cells != UNKNOWN) & (grid.cells < 100.0 * FREE_THRESH)
    image = np.full(grid.cells.shape, GREY_UNKNOWN, dtype=np.uint8)
    image[occupied], image[free] = BLACK_OCCUPIED, WHITE_FREE
    description = (
        f"image: {pgm_path.name}\n"
        f"resolution: {grid.resolution_m!r}\n"
        f"origin: [{float(grid.origin_x_m)!r}, {float(grid.origin_y_m)!r}, 0.0]\n"
        "negate: 0\n"
        f"occupied_thresh: {OCCUPIED_THRESH}\n"
        f"free_thresh: {FREE_THRESH}\n"
    )
    _write(pgm_path, encode_pgm(image[::-1]))  # the image's first row is the map's largest y
    _write(yaml_path, description.encode())
    return pgm_path


def load_map(yaml_path: Path) -> OccupancyGrid:
    """Read a map by its description; the image's path is relative to it.

    Raises
    ------
    ThumperError
        A file is missing or broken; the message names the file, the key and the value.
    """
    description, occupancy = read_occupancy(yaml_path, ("trinary",))
    return _grid(description, occupancy)


def load_rotated_map(yaml_path: Path) -> tuple[OccupancyGrid, float]:
    """Read a map whose origin may have a yaw: it is turned so that it has none. Returns that yaw, too.

    Raises
    ------
    ThumperError
        As `load_map`, but for the yaw.
    """
    description, occupancy = read_occupancy(yaml_path, ("trinary",), turned=True)
    grid = _grid(description, occupancy)
    if description.yaw_rad == 0.0:
        return grid, 0.0
    turned = rotate(replace(grid, origin_x_m=0.0, origin_y_m=0.0), description.yaw_rad)
    x_m, y_m = turned.origin_x_m + grid.origin_x_m, turned.origin_y_m + grid.origin_y_m
    return replace(turned, origin_x_m=x_m, origin_y_m=y_m), description.yaw_rad


def _grid(description: Description, occupancy: NDArray[np.float64]) -> OccupancyGrid:
    cells = np.full(occupancy.shape, UNKNOWN, dtype=np.int8)
    cells[occupancy > description.occupied_thresh] = OCCUPIED
    cells[occupancy < description.free_thresh] = FREE
    return OccupancyGrid(
        cells=cells,
        resolution_m=description.resolution_m,
        origin_x_m=description.origin_x_m,
        origin_y_m=description.origin_y_m,
    )


def read_occupancy(
    yaml_path: Path, modes: tuple[str, ...], *, turned: bool = False
) -> tuple[Description, NDArray[np.float64]]:
    """Read a map's description, whose mode must be one of `modes`, and how dark each cell is: 0 white to 1
    black, shape (rows, cols), row 0 the smallest y; with `negate` the other way round.

    Only where `turned` may the origin have a yaw.

    Raises
    ------
    ThumperError
        As `load_map`.
    """
    content = _read(yaml_path)
    if content.startswith((b"P5", b"P2", b"\x89PNG")):
        raise ThumperError(
            f"{yaml_path}: this is the map's image; give its description, the .yaml beside it",
            exit_code=EXIT_USAGE,
        )
    if content.startswith(b'{"thumper_session"'):
        raise ThumperError(
            f"{yaml_path}: this is a session, for --session; its map is the .yaml beside it",
            exit_code=EXIT_USAGE,
        )
    description = _parse(yaml_path, content.decode("utf-8", errors="replace"), modes)
    if description.yaw_rad != 0.0 and not turned:
        raise ThumperError(
            f"{yaml_path}: origin has the yaw {description.yaw_rad:g}; "
            f"turn it with `thumper edit {yaml_path} --out NEW.yaml`",
            exit_code=EXIT_USAGE,
        )
    pgm_path = yaml_path.parent / description.image
    try:
        image = decode_pgm(_read(pgm_path))
    except ValueError as error:
        raise ThumperError(
            f"{pgm_path}: {error}; save the map again, as an 8-bit PGM image", exit_code=EXIT_USAGE
        ) from error
    grey = image[::-1].astype(np.float64)
    return description, grey / 255.0 if description.negate else (255.0 - grey) / 255.0


def _parse(path: Path, text: str, modes: tuple[str, ...]) -> Description:
    values: dict[str, str] = {}
    for line in text.splitlines():
        key, colon, value = line.partition("#")[0].partition(":")
        if colon:
            values[key.strip()] = value.strip().strip("\"'")

    def text_of(key: str) -> str:
        if not values.get(key):
            raise ThumperError(
                f"{path}: key '{key}' is missing; add it as map_server's format asks", exit_code=EXIT_USAGE
            )
        return values[key]

    def number(key: str, value: str) -> float:
        try:
            result = float(value)
        except ValueError:
            result = math.nan
        if not math.isfinite(result):
            raise ThumperError(
                f"{path}: {key} = '{value}' is not a number; mend the value", exit_code=EXIT_USAGE
            )
        return result

    def within(key: str, low: float, high: float, *, ends: bool = False) -> float:
        result = number(key, text_of(key))
        if not (low < result < high or (ends and result in (low, high))):
            raise ThumperError(
                f"{path}: {key} = {result:g} must lie between {low:g} and {high:g}", exit_code=EXIT_USAGE
            )
        return result

    mode = values.get("mode", "trinary")
    if mode not in modes:
        raise ThumperError(
            f"{path}: mode = '{mode}' is not supported; save the map as '{modes[0]}'", exit_code=EXIT_USAGE
        )
    origin = text_of("origin")
    parts = origin.strip("[]").split(",")
    if not (origin.startswith("[") and origin.endswith("]") and len(parts) == 3):
        raise ThumperError(
            f"{path}: origin = '{origin}' is not of the form [x, y, yaw]; mend the value",
            exit_code=EXIT_USAGE,
        )
    x_m, y_m, yaw_rad = (number("origin", part) for part in parts)
    graded = mode != "trinary"  # there the thresholds are the ends of the scale
    free_thresh = within("free_thresh", 0.0, 1.0, ends=graded)
    return Description(
        image=text_of("image"),
        mode=mode,
        resolution_m=within("resolution", 0.0, 10.0),
        origin_x_m=x_m,
        origin_y_m=y_m,
        yaw_rad=yaw_rad,
        negate=number("negate", text_of("negate")) != 0.0,
        occupied_thresh=within("occupied_thresh", free_thresh, 1.0, ends=graded),
        free_thresh=free_thresh,
    )


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise ThumperError(
            f"{path}: cannot be read ({error.strerror}); check the path", exit_code=EXIT_USAGE
        ) from error


def _write(path: Path, data: bytes) -> None:
    """Write to a neighbour, flush to the disk, then rename: a reader never sees half a file."""
    partial = path.with_name(path.name + ".part")
    try:
        with partial.open("wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(path)
    except OSError as error:
        raise ThumperError(
            f"{path}: cannot be written ({error.strerror}); check the folder", exit_code=EXIT_USAGE
        ) from error
