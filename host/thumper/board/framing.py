"""Frames on the wire: COBS(id, sequence, payload, CRC-16 little-endian) and a zero byte. Pure."""

from dataclasses import dataclass

from cobs import cobs

DELIMITER = b"\x00"
OVERHEAD_BYTES = 4  # id, sequence, CRC-16
MAX_ENCODED_BYTES = 128  # anything longer without a delimiter is noise


def _crc_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0x8408 if crc & 1 else 0)
        table.append(crc)
    return tuple(table)


_CRC_TABLE = _crc_table()


def crc16(data: bytes) -> int:
    """Return the CRC-16/X-25: reflected (0x8408), initial value 0xFFFF, complemented.

    The complement makes the check fail if the last byte is lost.
    """
    crc = 0xFFFF
    for byte in data:
        crc = (crc >> 8) ^ _CRC_TABLE[(crc ^ byte) & 0xFF]
    return crc ^ 0xFFFF


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One complete frame with a valid CRC."""

    message_id: int
    sequence: int
    payload: bytes


def encode_frame(message_id: int, sequence: int, payload: bytes) -> bytes:
    """Return the bytes to send, including the delimiter."""
    body = bytes((message_id, sequence)) + payload
    return bytes(cobs.encode(body + crc16(body).to_bytes(2, "little"))) + DELIMITER


class FrameDecoder:
    """Splits a byte stream into frames; drops frames that fail the CRC and counts them in `errors`."""

    def __init__(self) -> None:
        self.errors = 0
        self._pending = bytearray()

    def feed(self, data: bytes) -> list[Frame]:
        """Append received bytes and return the frames that they complete, in order."""
        frames = []
        self._pending += data
        while (end := self._pending.find(DELIMITER)) >= 0:
            encoded = bytes(self._pending[:end])
            del self._pending[: end + 1]
            if encoded:  # two delimiters in a row are legal: a sender flushes noise with one
                frame = _decode(encoded)
                if frame is None:
                    self.errors += 1
                else:
                    frames.append(frame)
        if len(self._pending) > MAX_ENCODED_BYTES:
            self._pending.clear()
            self.errors += 1
        return frames


def _decode(encoded: bytes) -> Frame | None:
    try:
        body = cobs.decode(encoded)
    except cobs.DecodeError:
        return None
    if len(body) < OVERHEAD_BYTES or crc16(body[:-2]) != int.from_bytes(body[-2:], "little"):
        return None
    return Frame(message_id=body[0], sequence=body[1], payload=bytes(body[2:-2]))
