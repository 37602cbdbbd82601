"""Read a part of a recording by its index: without reading what comes before it."""

import os
import struct
import zlib
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from heapq import heappop, heappush
from itertools import count
from pathlib import Path
from typing import IO

from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.records import Chunk, ChunkIndex, Message
from mcap.stream_reader import StreamReader
from mcap.summary import Summary
from zstandard import ZstdError

from thumper.common.errors import ThumperError
from thumper.common.files import open_regular
from thumper.recording.chunks import ChunkReader
from thumper.recording.reader import RecordedMessage

DAMAGED = (
    *(McapError, ZstdError, zlib.error, struct.error, EOFError, ValueError, KeyError, RuntimeError),
    *(MemoryError, OverflowError),  # of a length that is wrong
)


class Excerpts:
    """One finished file of a recording, read in parts."""

    def __init__(self, stream: IO[bytes], summary: Summary) -> None:
        self._stream, self._summary = stream, summary
        self._size = os.fstat(stream.fileno()).st_size
        assert summary.statistics is not None
        self.start_ns = summary.statistics.message_start_time
        self.end_ns = summary.statistics.message_end_time

    def latest_before(self, topics: Collection[str], time_ns: int) -> Iterator[RecordedMessage]:
        """Yield the newest message of each topic before a time."""
        chunks = ChunkReader(self._stream.name, self._size)
        found: dict[str, RecordedMessage] = {}
        for index in sorted(self._summary.chunk_indexes, key=lambda each: -each.message_end_time):
            settled = {name for name, message in found.items() if message.log_ns >= index.message_end_time}
            wanted = self._topics_in(index).intersection(topics) - settled
            if not wanted or index.message_start_time >= time_ns:
                continue
            for message in self._messages_in(index, chunks):
                newest = found.get(message.topic, message)
                if message.topic in wanted and newest.log_ns <= message.log_ns < time_ns:
                    found[message.topic] = message
        yield from found.values()

    def messages(self, topics: Collection[str], start_ns: int, end_ns: int) -> Iterator[RecordedMessage]:
        """Yield the messages of a time range, its end excluded, in the order of their times."""
        chunks, order = ChunkReader(self._stream.name, self._size), count()
        waiting: list[tuple[int, int, RecordedMessage]] = []  # a heap: chunks may overlap
        for index in sorted(self._summary.chunk_indexes, key=lambda each: each.message_start_time):
            if index.message_end_time < start_ns or index.message_start_time >= end_ns:
                continue
            if self._topics_in(index).isdisjoint(topics):
                continue
            while waiting and waiting[0][0] < index.message_start_time:
                yield heappop(waiting)[2]
            for message in self._messages_in(index, chunks):
                if message.topic in topics and start_ns <= message.log_ns < end_ns:
                    heappush(waiting, (message.log_ns, next(order), message))
        while waiting:
            yield heappop(waiting)[2]

    def _topics_in(self, index: ChunkIndex) -> set[str]:
        channels = self._summary.channels
        return {channels[number].topic.removeprefix("/") for number in index.message_index_offsets}

    def _messages_in(self, index: ChunkIndex, chunks: ChunkReader) -> Iterator[RecordedMessage]:
        self._stream.seek(index.chunk_start_offset)
        reader = StreamReader(self._stream, skip_magic=True, emit_chunks=True, record_size_limit=self._size)
        chunk = next(reader.records, None)
        if not isinstance(chunk, Chunk):
            raise ValueError("no chunk")
        for record in chunks.records(chunk):
            if isinstance(record, Message):
                channel = self._summary.channels[record.channel_id]
                schema = self._summary.schemas.get(channel.schema_id)
                message = RecordedMessage.of(schema, channel, record)
                if message is None:
                    raise ValueError(channel.topic)
                yield message


@contextmanager
def open_excerpts(path: Path) -> Iterator[Excerpts]:
    """Open a recording for reading in parts.

    Raises
    ------
    ThumperError
        The file cannot be read, is no MCAP file, is damaged, empty, has no index, or unpacks to far more than
        a recording.
    """
    try:
        with open_regular(path) as stream:
            limit = os.fstat(stream.fileno()).st_size
            summary = SeekingReader(stream, record_size_limit=limit).get_summary()
            if summary is None or summary.statistics is None or not summary.chunk_indexes:
                raise ThumperError(f"{path.name}: it has no index; `thumper recover` writes one")
            yield Excerpts(stream, summary)
    except OSError as error:
        raise ThumperError(f"{path.name}: cannot be read ({error.strerror}); check the path") from error
    except DAMAGED as error:
        raise ThumperError(f"{path.name}: damaged, or not an MCAP file") from error
