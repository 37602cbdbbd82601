"""Read the public map files that tests and benchmarks use."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from thumper.navigation.footprint import Footprint

# The outline with which the recorded data of ROS were made: as wide as the track, without the tyres.
ROS_FOOTPRINT = Footprint.rectangle(length_m=0.42, width_m=0.245)


def read_pgm(path: Path) -> NDArray[np.uint8]:
    """Return the pixels of an 8-bit binary PGM, shape (rows, cols), row 0 at the smallest y."""
    data = path.read_bytes()
    fields: list[bytes] = []
    offset = 0
    while len(fields) < 4:
        end = data.index(b"\n", offset)
        fields += data[offset:end].split(b"#")[0].split()
        offset = end + 1
    cols, rows = int(fields[1]), int(fields[2])
    pixels = np.frombuffer(data, np.uint8, rows * cols, offset).reshape(rows, cols)
    return np.ascontiguousarray(pixels[::-1])


def read_trinary(path: Path) -> NDArray[np.int8]:
    """Return the occupancy of a map_server PGM with its default thresholds 0.65 and 0.196: 100, 0 or -1."""
    occupied = (255.0 - read_pgm(path)) / 255.0
    return np.where(occupied > 0.65, 100, np.where(occupied < 0.196, 0, -1)).astype(np.int8)


def read_octile(path: Path) -> NDArray[np.bool_]:
    """Return the passable cells of a MovingAI map, shape (rows, cols), top row first as in its scenarios."""
    lines = path.read_text().splitlines()
    rows = int(lines[1].split()[1])
    return np.array([[cell in ".GS" for cell in line] for line in lines[4 : 4 + rows]])
