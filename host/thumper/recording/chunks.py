"""Unpack the chunks of an MCAP file within limits: ten megabytes may hold ten gigabytes of zeros."""

import zlib
from collections.abc import Iterator
from io import BytesIO

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema

from thumper.common.errors import EXIT_USAGE, ThumperError

MAX_CHUNK_MB = 128  # recorders write chunks below 10 MB, unless one message is larger
MAX_RATIO = 200  # between the content of a file and its size; recordings of a robot have 4
MIN_RECORD_BYTES = 4  # in the file; the index alone has 16 per message
SPARE_RECORDS = 10_000
PREFIX_BYTES = 9  # of a record: its kind and its length


class ChunkReader:
    """Reads the chunks of one file."""

    def __init__(self, name: str, file_bytes: int) -> None:
        """`name` is the file in error texts."""
        self._name = name
        self._bytes_left = int(1e6 * MAX_CHUNK_MB) + MAX_RATIO * file_bytes
        self._records_left = SPARE_RECORDS + file_bytes // MIN_RECORD_BYTES

    def records(self, chunk: Chunk) -> Iterator[Schema | Channel | Message]:
        """Yield the records of a chunk.

        Raises
        ------
        ThumperError
            The file unpacks to more than the limits.
        Exception
            Any other, if the chunk is damaged; none of its records if its checksum is wrong.
        """
        data, at = self._unpack(chunk), 0
        if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
            raise ValueError("wrong checksum")
        while at < len(data):
            self._records_left -= 1
            if self._records_left < 0:
                raise self._too_much("records than fit in its size")
            kind, length = data[at], int.from_bytes(data[at + 1 : at + PREFIX_BYTES], "little")
            at += PREFIX_BYTES + length
            if at > len(data):
                raise ValueError("a record without its end")
            content = ReadDataStream(BytesIO(data[at - length : at]))
            if kind == Opcode.MESSAGE:
                yield Message.read(content, length)
            elif kind == Opcode.SCHEMA:
                yield Schema.read(content)
            elif kind == Opcode.CHANNEL:
                yield Channel.read(content)

    def _unpack(self, chunk: Chunk) -> bytes:
        limit = min(int(1e6 * MAX_CHUNK_MB), self._bytes_left)
        if chunk.compression == "zstd":  # a frame may claim another size than the chunk: trust neither
            data = zstandard.ZstdDecompressor().stream_reader(chunk.data).read(limit + 1)
        elif chunk.compression == "lz4":
            data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, limit + 1)
        elif chunk.compression == "":
            data = chunk.data
        else:
            raise ValueError(f"compressed with {chunk.compression!r}")
        if len(data) > limit:
            raise self._too_much(f"than {MAX_CHUNK_MB} MB in one chunk or {MAX_RATIO} times its size")
        self._bytes_left -= len(data)
        return data

    def _too_much(self, what: str) -> ThumperError:
        text = f"{self._name}: unpacks to more {what}; it is no recording of a robot"
        return ThumperError(text, exit_code=EXIT_USAGE)
