"""Readers for the public map files used by tests and benchmarks."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def read_pgm(path: Path) -> NDArray[np.uint8]:
    """Pixels of an 8-bit binary PGM, shape (rows, cols), row 0 the smallest y as in `OccupancyGrid`."""
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
    """Occupancy of a map_server PGM with the usual thresholds 0.65 and 0.196: 100, 0 or -1."""
    occupied = (255.0 - read_pgm(path)) / 255.0
    return np.where(occupied > 0.65, 100, np.where(occupied < 0.196, 0, -1)).astype(np.int8)


def read_octile(path: Path) -> NDArray[np.bool_]:
    """Passable cells of a MovingAI map, shape (rows, cols), top row first as its scenarios count."""
    lines = path.read_text().splitlines()
    rows = int(lines[1].split()[1])
    return np.array([[cell in ".GS" for cell in line] for line in lines[4 : 4 + rows]])
