"""Encode the replies of a SCIP 2.0 lidar (Hokuyo C-42-03320B). Pure functions."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

BLOCK_CHARS = 64


def encode(value: int, chars: int) -> bytes:
    """Encode a value in `chars` characters of six bits, most significant first, each + 0x30."""
    return bytes(0x30 + (value >> shift & 0x3F) for shift in range(6 * (chars - 1), -1, -6))


def checksum(text: bytes) -> bytes:
    """Return the low six bits of the sum of the bytes, + 0x30."""
    return bytes([0x30 + (sum(text) & 0x3F)])


def with_checksum(text: bytes) -> bytes:
    """Return a line of a reply: the text, its checksum and a line feed."""
    return text + checksum(text) + b"\n"


def status_reply(echo: bytes, status: bytes) -> bytes:
    """Return a reply without data."""
    return echo + b"\n" + with_checksum(status) + b"\n"


def table_reply(echo: bytes, table: Mapping[str, str]) -> bytes:
    """Return the reply to VV, PP and II: lines `KEY:value;sum`; the sum excludes the semicolon."""
    lines = []
    for key, value in table.items():
        text = f"{key}:{value}".encode("ascii")
        lines.append(text + b";" + checksum(text) + b"\n")
    return echo + b"\n" + with_checksum(b"00") + b"".join(lines) + b"\n"


def time_reply(echo: bytes, stamp_ms: int) -> bytes:
    """Return the reply to TM1."""
    return echo + b"\n" + with_checksum(b"00") + with_checksum(encode(stamp_ms, 4)) + b"\n"


def scan_reply(echo: bytes, status: bytes, stamp_ms: int, values_mm: NDArray[np.int32], chars: int) -> bytes:
    """Return a reply with a scan, in blocks of 64 characters; a value may span two blocks."""
    shifts = np.arange(6 * (chars - 1), -1, -6)
    clipped = np.minimum(values_mm, (1 << 6 * chars) - 1)
    data = (0x30 + (clipped[:, None] >> shifts & 0x3F)).astype(np.uint8).tobytes()
    blocks = (with_checksum(data[start : start + BLOCK_CHARS]) for start in range(0, len(data), BLOCK_CHARS))
    return (
        echo + b"\n" + with_checksum(status) + with_checksum(encode(stamp_ms, 4)) + b"".join(blocks) + b"\n"
    )
