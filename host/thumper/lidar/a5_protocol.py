"""Requests and replies of RPLIDAR and YDLIDAR: both makers use the same frames. Pure: no port, no clock.

A request is A5, a command and, if there is one, a payload between its length and the XOR of all bytes. A
reply starts with A5 5A, its length (30 bits), whether data follows for ever (2 bits) and its type.
Sources: Slamtec LR001 (interface protocol), YDLIDAR X4 development manual.
"""

import struct
from collections.abc import Container
from dataclasses import dataclass
from functools import reduce
from operator import xor

SYNC = 0xA5
INFO_TYPE, HEALTH_TYPE, SAMPLE_RATE_TYPE = 0x04, 0x06, 0x15
HEALTH_ERROR = 2

_REPLY_START = b"\xa5\x5a"
_DESCRIPTOR = struct.Struct("<2sIB")
_INFO = struct.Struct("<BBBB16s")
_LENGTH_BITS = 30


def request(command: int, payload: bytes = b"") -> bytes:
    """Return the bytes of a request."""
    if not payload:
        return bytes((SYNC, command))
    body = bytes((SYNC, command, len(payload))) + payload
    return body + bytes((reduce(xor, body),))


def find_reply(data: bytes, types: Container[int]) -> tuple[int, bytes] | None:
    """Return type and content of the first complete reply of one of the `types`; None if there is none yet.

    The content of a reply that streams is all that follows it.
    """
    start = data.find(_REPLY_START)
    while start >= 0 and len(data) - start >= _DESCRIPTOR.size:
        _, length, kind = _DESCRIPTOR.unpack_from(data, start)
        content = data[start + _DESCRIPTOR.size :]
        if kind in types and length >> _LENGTH_BITS:
            return kind, content
        if kind in types and len(content) >= length:
            return kind, content[:length]
        start = data.find(_REPLY_START, start + 1)
    return None


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceInfo:
    """What a lidar answers when asked what it is."""

    model: int
    firmware: str
    hardware: int
    serial: str

    @classmethod
    def parse(cls, content: bytes) -> "DeviceInfo":
        """Parse the 20 bytes of the reply."""
        model, minor, major, hardware, serial = _INFO.unpack(content[: _INFO.size])
        return cls(model=model, firmware=f"{major}.{minor}", hardware=hardware, serial=serial.hex())
