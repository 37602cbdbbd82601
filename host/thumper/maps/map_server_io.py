"""Maps on disk: the PGM image and YAML metadata of ROS's map_server.

Format: http://wiki.ros.org/map_server, "trinary" mode. The metadata are six keys on six lines, so this module
needs no YAML library.
"""

import math
import re
import warnings
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.files import read_bytes, unreadable, write_text, write_whole
from thumper.gps.earth_reference import MapDatum
from thumper.gps.local_plane import LatLon
from thumper.maps.edit import rotate
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

YAML_MAX_MB, IMAGE_MAX_MB = 1.0, 200.0
MAX_NUMBER = 1e8  # an origin beyond it leaves too few digits for the cells
FREE_THRESH, OCCUPIED_THRESH = 0.196, 0.65
WHITE_FREE, BLACK_OCCUPIED, GREY_UNKNOWN = 254, 0, 205
# 0.196 is 50/255. Grey 205 lies exactly on it; the strict comparison in `_grid` keeps it unknown.

ImageArray = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class MapMetadata:
    """Content of the YAML file; `mode` is trinary, scale or raw."""

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
    """Return the YAML path of the map `name`. Any suffix except .yaml is part of the name."""
    return Path(f"{str(name).removesuffix('.yaml')}.yaml")


def save_map(grid: OccupancyGrid, yaml_path: Path, datum: MapDatum | None = None) -> Path:
    """Write `yaml_path` and the image beside it, with the suffix `.pgm`; return the image's path.

    Each file is written completely or not at all, the image first. Cells of 65 % and more become occupied,
    cells below 19.6 % free, the rest unknown. The place on Earth is a key that map_server ignores.

    Raises
    ------
    ThumperError
        The directory is not writable.
    """
    grid = grid.with_a_cell()
    pgm_path = yaml_path.with_suffix(".pgm")
    occupied = grid.cells >= 100.0 * OCCUPIED_THRESH
    free = (grid.cells != UNKNOWN) & (grid.cells < 100.0 * FREE_THRESH)
    image = np.full(grid.cells.shape, GREY_UNKNOWN, dtype=np.uint8)
    image[occupied], image[free] = BLACK_OCCUPIED, WHITE_FREE
    metadata = (
        f"image: {pgm_path.name}\n"
        f"resolution: {grid.resolution_m!r}\n"
        f"origin: [{float(grid.origin_x_m)!r}, {float(grid.origin_y_m)!r}, 0.0]\n"
        "negate: 0\n"
        f"occupied_thresh: {OCCUPIED_THRESH}\n"
        f"free_thresh: {FREE_THRESH}\n"
    )
    if datum is not None:
        metadata += f"datum: {list(datum)!r}\n"
    with write_whole(pgm_path) as stream:
        stream.write(encode_pgm(image[::-1]))  # the image's first row is the map's largest y
    write_text(yaml_path, metadata)
    return pgm_path


def load_map(yaml_path: Path) -> OccupancyGrid:
    """Read a map from its YAML file; the path of the image is relative to that file.

    Raises
    ------
    ThumperError
        A file is missing or invalid; the message names the file, the key and the value.
    """
    metadata, occupancy = read_occupancy(yaml_path, ("trinary",))
    return _grid(metadata, occupancy)


def load_rotated_map(yaml_path: Path) -> tuple[OccupancyGrid, float]:
    """Read a map whose origin may have a yaw, and rotate it so that it has none; return the yaw, too.

    Raises
    ------
    ThumperError
        As `load_map`, except for the yaw.
    """
    metadata, occupancy = read_occupancy(yaml_path, ("trinary",), allow_yaw=True)
    grid = _grid(metadata, occupancy)
    if metadata.yaw_rad == 0.0:
        return grid, 0.0
    rotated = rotate(replace(grid, origin_x_m=0.0, origin_y_m=0.0), metadata.yaw_rad)
    x_m, y_m = rotated.origin_x_m + grid.origin_x_m, rotated.origin_y_m + grid.origin_y_m
    return replace(rotated, origin_x_m=x_m, origin_y_m=y_m), metadata.yaw_rad


def load_datum(yaml_path: Path) -> MapDatum | None:
    """Read the place of a map on Earth from its YAML file; None if it has none.

    Raises
    ------
    ThumperError
        The file is missing, or its `datum` is not latitude, longitude [deg] and direction of x [rad].
    """
    content = _read(yaml_path, YAML_MAX_MB).decode("utf-8", errors="replace")
    match = re.search(r"^datum:\s*\[(.*)\]\s*$", content, re.MULTILINE)
    if match is None:
        return None
    try:
        latitude_deg, longitude_deg, yaw_rad = map(float, match[1].split(","))
    except ValueError:
        latitude_deg = longitude_deg = yaw_rad = math.nan
    if not (LatLon(latitude_deg, longitude_deg).is_valid and abs(yaw_rad) <= math.tau):
        raise ThumperError(
            f"{yaml_path}: datum = [{match[1]}] is not [latitude_deg, longitude_deg, yaw_rad]; correct it",
            exit_code=EXIT_USAGE,
        )
    return MapDatum(latitude_deg, longitude_deg, yaw_rad)


def _grid(metadata: MapMetadata, occupancy: NDArray[np.float64]) -> OccupancyGrid:
    cells = np.full(occupancy.shape, UNKNOWN, dtype=np.int8)
    cells[occupancy > metadata.occupied_thresh] = OCCUPIED
    cells[occupancy < metadata.free_thresh] = FREE
    return OccupancyGrid(
        cells=cells,
        resolution_m=metadata.resolution_m,
        origin_x_m=metadata.origin_x_m,
        origin_y_m=metadata.origin_y_m,
    )


def read_occupancy(
    yaml_path: Path, modes: tuple[str, ...], *, allow_yaw: bool = False
) -> tuple[MapMetadata, NDArray[np.float64]]:
    """Return a map's metadata and the darkness of its cells: 0 white to 1 black, inverted by `negate`.

    The darkness has shape (rows, cols), with row 0 at the smallest y. The mode must be one of `modes`. The
    origin may have a yaw only with `allow_yaw`.

    Raises
    ------
    ThumperError
        As `load_map`.
    """
    content = _read(yaml_path, YAML_MAX_MB)
    if content.startswith((b"P5", b"P2", b"\x89PNG")):
        raise ThumperError(
            f"{yaml_path}: this is the map's image; pass the .yaml file beside it", exit_code=EXIT_USAGE
        )
    if content.startswith(b'{"thumper_session"'):
        raise ThumperError(
            f"{yaml_path}: this is a session file, for --session; its map is the .yaml file beside it",
            exit_code=EXIT_USAGE,
        )
    metadata = _parse(yaml_path, content.decode("utf-8", errors="replace"), modes)
    if metadata.yaw_rad != 0.0 and not allow_yaw:
        raise ThumperError(
            f"{yaml_path}: the origin has a yaw of {metadata.yaw_rad:g}; "
            f"rotate the map with `thumper edit {yaml_path} --out NEW.yaml`",
            exit_code=EXIT_USAGE,
        )
    pgm_path = yaml_path.parent / metadata.image
    try:
        image = _decode_pgm(_read(pgm_path, IMAGE_MAX_MB))
    except ValueError as error:
        raise ThumperError(
            f"{pgm_path}: {error}; save the map again, as an 8-bit PGM image", exit_code=EXIT_USAGE
        ) from error
    grey = image[::-1].astype(np.float64)
    return metadata, grey / 255.0 if metadata.negate else (255.0 - grey) / 255.0


def encode_pgm(image: ImageArray) -> bytes:
    """Return the P5 file of an image, shape (rows, columns), first row on top."""
    from PIL import Image  # deferred: loading it takes 0.1 s

    stream = BytesIO()
    Image.fromarray(image).save(stream, format="PPM")
    return stream.getvalue()


def _decode_pgm(data: bytes) -> ImageArray:
    """Return the image, shape (rows, columns); raise ValueError if it is not an 8-bit PGM image."""
    from PIL import Image, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(BytesIO(data), formats=("PPM",)) as image:
                image.load()
                if image.mode != "L":
                    raise ValueError(f"its pixels have Pillow's mode {image.mode}")
                return np.array(image)
    except (Image.DecompressionBombWarning, Image.DecompressionBombError) as error:
        raise ValueError(f"has more than {Image.MAX_IMAGE_PIXELS} pixels") from error
    except UnidentifiedImageError as error:
        raise ValueError(f"is not a PGM image (it starts with {data[:2]!r})") from error
    except OSError as error:
        raise ValueError(f"is cut off ({error})") from error
    except ValueError as error:
        raise ValueError(f"is not a valid 8-bit PGM image ({error})") from error


def _keys(path: Path, text: str) -> dict[str, str]:
    """Return the text of each key; raise ThumperError if it is no map file at all."""
    values: dict[str, str] = {}
    for line in text.splitlines():
        key, colon, value = line.partition("#")[0].partition(":")
        if colon:
            values[key.strip()] = value.strip().strip("\"'")
    if values.keys().isdisjoint(("image", "resolution", "origin")):
        raise ThumperError(
            f"{path}: not a map file; pass the .yaml file of a saved map", exit_code=EXIT_USAGE
        )
    return values


def _parse(path: Path, text: str, modes: tuple[str, ...]) -> MapMetadata:
    values = _keys(path, text)

    def text_of(key: str) -> str:
        if not values.get(key):
            raise ThumperError(
                f"{path}: key '{key}' is missing; add it as in map_server's format", exit_code=EXIT_USAGE
            )
        return values[key]

    def number(key: str, value: str) -> float:
        try:
            result = float(value)
        except ValueError:
            result = math.nan
        if not abs(result) < MAX_NUMBER:
            raise ThumperError(
                f"{path}: {key} = '{value}' is not a number below {MAX_NUMBER:g}; correct the value",
                exit_code=EXIT_USAGE,
            )
        return result

    def number_between(key: str, low: float, high: float, *, inclusive: bool = False) -> float:
        result = number(key, text_of(key))
        if not (low < result < high or (inclusive and result in (low, high))):
            raise ThumperError(
                f"{path}: {key} = {result:g} is not between {low:g} and {high:g}", exit_code=EXIT_USAGE
            )
        return result

    mode = values.get("mode", "trinary")
    if mode not in modes:
        raise ThumperError(
            f"{path}: mode = '{mode}' is not supported; save the map in mode '{modes[0]}'",
            exit_code=EXIT_USAGE,
        )
    origin = text_of("origin")
    parts = origin.strip("[]").split(",")
    if not (origin.startswith("[") and origin.endswith("]") and len(parts) == 3):
        raise ThumperError(
            f"{path}: origin = '{origin}' does not have the form [x, y, yaw]", exit_code=EXIT_USAGE
        )
    x_m, y_m, yaw_rad = (number("origin", part) for part in parts)
    graded = mode != "trinary"  # then the thresholds are the ends of the scale
    free_thresh = number_between("free_thresh", 0.0, 1.0, inclusive=graded)
    return MapMetadata(
        image=text_of("image"),
        mode=mode,
        resolution_m=number_between("resolution", 0.0, 10.0),
        origin_x_m=x_m,
        origin_y_m=y_m,
        yaw_rad=yaw_rad,
        negate=number("negate", text_of("negate")) != 0.0,
        occupied_thresh=number_between("occupied_thresh", free_thresh, 1.0, inclusive=graded),
        free_thresh=free_thresh,
    )


def _read(path: Path, limit_MB: float) -> bytes:
    try:
        return read_bytes(path, limit_MB)
    except OSError as error:
        raise unreadable(path, error) from error
