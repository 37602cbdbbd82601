"""SCIP 2.0, host side: encode requests, parse replies (Hokuyo C-42-03320B). Pure: no port.

A reply consists of lines that end with LF, and ends with an empty line: the echo of the request, a status of
two characters with its checksum, then data lines, each with a checksum. Values have six bits per character,
each + 0x30, most significant first. Scan data comes in blocks of 64 characters; a value may span two blocks.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MAX_REPLY_BYTES = 8192
STAMP_CHARS = 4
CLOCK_WRAP_MS = 1 << 24
STATUS_OK, STATUS_SCAN = "00", "99"

RangeArray = NDArray[np.int32]


class ScipError(ValueError):
    """The bytes are not a reply, or a checksum is wrong."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """One reply: echo and status without checksum; data lines as received, with their checksum."""

    echo: str
    status: str
    lines: tuple[bytes, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RawScan:
    """One scan as sent: device clock [ms, wraps at 2**24] and ranges [mm]; values below 20 are codes."""

    stamp_ms: int
    values_mm: RangeArray


class ReplySplitter:
    """Splits a byte stream into replies; drops an endless reply, so that memory stays bounded."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.overruns = 0

    def feed(self, data: bytes) -> list[bytes]:
        """Return the replies that `data` completes, without the empty line at their end."""
        self._buffer += data.replace(b"\r\n", b"\n")
        *replies, rest = bytes(self._buffer).split(b"\n\n")
        if len(rest) > MAX_REPLY_BYTES:
            self.overruns += 1
            rest = b""
        self._buffer = bytearray(rest)
        return [reply for reply in replies if reply.strip(b"\n")]

    def clear(self) -> None:
        """Drop an incomplete reply."""
        self._buffer.clear()


def checksum(text: bytes) -> int:
    """Return the check character of a line: the low six bits of the sum of its bytes, + 0x30."""
    return 0x30 + (sum(text) & 0x3F)


def encode_value(value: int, chars: int) -> bytes:
    """Encode an unsigned value in `chars` characters.

    Raises
    ------
    ValueError
        The value does not fit in 6 * chars bits.
    """
    if not 0 <= value < 1 << 6 * chars:
        raise ValueError(f"{value} does not fit in {chars} characters of 6 bits")
    return bytes(0x30 + (value >> 6 * place & 0x3F) for place in reversed(range(chars)))


def decode_values(text: bytes, chars: int) -> RangeArray:
    """Decode values of `chars` (1 to 4) characters each, shape (len(text) / chars,).

    Raises
    ------
    ScipError
        A character is outside 0x30 ... 0x6F, or the length is not a multiple of `chars`.
    """
    if len(text) % chars:
        raise ScipError(f"{len(text)} characters are not a multiple of {chars}")
    digits = np.frombuffer(text, np.uint8).astype(np.int32) - 0x30  # signed, because uint8 would wrap
    if np.any((digits < 0) | (digits > 0x3F)):
        raise ScipError("a character outside 0x30 ... 0x6F")
    places = 64 ** np.arange(chars - 1, -1, -1, dtype=np.int32)
    return np.asarray(digits.reshape(-1, chars) @ places, np.int32)


def stream_request(
    first_step: int, last_step: int, *, cluster: int = 1, skip: int = 0, count: int = 0
) -> bytes:
    """Return the MD request: `count` scans (0: endless) of the steps, three characters per value."""
    return b"MD%04d%04d%02d%d%02d\n" % (first_step, last_step, cluster, skip, count)


def parse_reply(raw: bytes) -> Reply:
    """Parse one reply from `ReplySplitter` and check its status line.

    Raises
    ------
    ScipError
        The status line is missing, or its checksum is wrong.
    """
    lines = raw.lstrip(b"\n").split(b"\n")
    if len(lines) < 2:
        raise ScipError("no status line")
    status = lines[1]
    if len(status) == 2:  # SCIP 1.1 has no checksums, and some firmware answers RS without one
        return Reply(echo=_text(lines[0]), status=_text(status), lines=tuple(lines[2:]))
    if len(status) != 3 or status[2] != checksum(status[:2]):
        raise ScipError(f"bad status line {status!r}")
    return Reply(echo=_text(lines[0]), status=_text(status[:2]), lines=tuple(lines[2:]))


def parse_scan(reply: Reply, chars: int = 3) -> RawScan:
    """Return the stamp and ranges of an MD/MS or GD/GS reply; `chars` is 3 for ..D and 2 for ..S.

    Raises
    ------
    ScipError
        A line is missing or its checksum is wrong.
    """
    if not reply.lines:
        raise ScipError("a scan without a stamp")
    stamp, *blocks = map(_checked, reply.lines)
    if len(stamp) != STAMP_CHARS:
        raise ScipError(f"a stamp of {len(stamp)} characters")
    return RawScan(
        stamp_ms=int(decode_values(stamp, STAMP_CHARS)[0]),
        values_mm=decode_values(b"".join(blocks), chars),
    )


def parse_time(reply: Reply) -> int:
    """Return the device's clock [ms] from a TM1 reply.

    Raises
    ------
    ScipError
        The reply has no clock, or its checksum is wrong.
    """
    if len(reply.lines) != 1 or len(reply.lines[0]) != STAMP_CHARS + 1:
        raise ScipError("no clock in the reply")
    return int(decode_values(_checked(reply.lines[0]), STAMP_CHARS)[0])


def parse_table(reply: Reply) -> tuple[dict[str, str], int]:
    """Return the `KEY:value;sum` lines of VV, PP or II, and how many had a wrong checksum.

    The checksum excludes the semicolon. One that includes it is valid, too, because some firmware sends it. A
    line with a wrong checksum is kept: some URG-04LX corrupt their serial number but work otherwise.
    """
    table, bad = {}, 0
    for line in reply.lines:
        key, colon, value = _text(line).partition(":")
        if not colon:
            bad += 1
            continue
        if len(line) < 2 or line[-1] not in {checksum(line[:-1]), checksum(line[:-1].removesuffix(b";"))}:
            bad += 1
        table[key] = value[:-1].removesuffix(";")
    return table, bad


def _checked(line: bytes) -> bytes:
    if not line or line[-1] != checksum(line[:-1]):
        raise ScipError("wrong checksum")
    return line[:-1]


def _text(line: bytes) -> str:
    return line.decode("ascii", "replace")
