"""Binary packets for the browsers: one per tick, the same bytes for every page.

A packet is the length of a JSON header (uint32, little-endian), the header, padding to four bytes, then the
arrays. The header holds the small values, and under `arrays` the position of each array:
`name: [offset in bytes, count, kind]`, kind `f4` (float32) or `u1` (bytes, a PNG).
"""

import json
import struct
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

ALIGNMENT_BYTES = 4

PacketArray = NDArray[Any] | bytes


def encode_packet(values: Mapping[str, Any], arrays: Mapping[str, PacketArray]) -> bytes:
    """Return the packet; float arrays are sent as float32, bytes unchanged."""
    layout: dict[str, tuple[int, int, str]] = {}
    body = bytearray()
    for name, array in arrays.items():
        if isinstance(array, bytes):
            raw, count, kind = array, len(array), "u1"
        else:
            raw, count, kind = array.astype("<f4").tobytes(), int(array.size), "f4"
        layout[name] = (len(body), count, kind)
        body += raw + bytes(-len(raw) % ALIGNMENT_BYTES)
    header = json.dumps({**values, "arrays": layout}, separators=(",", ":"), allow_nan=False).encode()
    header += b" " * (-len(header) % ALIGNMENT_BYTES)
    return struct.pack("<I", len(header)) + header + bytes(body)


def grid_png(cells: NDArray[np.int8]) -> bytes:
    """Return cells, shape (rows, columns), as an 8-bit grey PNG.

    Row 0 is the bottom row of the map and the top row of the PNG. A pixel is the cell's value + 1:
    0 unknown, 1...101 occupancy. The page colours it.
    """
    rows, columns = cells.shape
    lines = np.zeros((rows, columns + 1), dtype=np.uint8)  # each line starts with its filter type, 0
    np.add(cells.view(np.uint8), np.uint8(1), out=lines[:, 1:])  # -1 is 255, and 255 + 1 is 0
    header = struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + _chunk(b"IHDR", header)
        + _chunk(b"IDAT", zlib.compress(lines.data, 1))
        + _chunk(b"IEND", b"")
    )


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
