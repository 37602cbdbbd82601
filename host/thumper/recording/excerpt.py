"""Read a part of a recording by its index: without reading what comes before it."""

import struct
import zlib
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from mcap.exceptions import McapError
from mcap.reader import McapReader, make_reader
from mcap.records import Channel, Message, Schema
from mcap.summary import Summary
from zstandard import ZstdError

from thumper.common.errors import ThumperError
from thumper.recording.reader import RecordedMessage


class Excerpts:
    """One finished file of a recording, read in parts."""

    def __init__(self, reader: McapReader, summary: Summary) -> None:
        self._reader = reader
        assert summary.statistics is not None
        self.start_ns = summary.statistics.message_start_time
        self.end_ns = summary.statistics.message_end_time

    def latest_before(self, topics: Collection[str], time_ns: int) -> Iterator[RecordedMessage]:
        """Yield the newest message of each topic before a time."""
        for topic in topics:
            found = self._reader.iter_messages(topics=f"/{topic}", ending_before=time_ns, reverse=True)
            newest = next(found, None)
            if newest is not None:
                yield _recorded(*newest)

    def messages(self, topics: Collection[str], start_ns: int, end_ns: int) -> Iterator[RecordedMessage]:
        """Yield the messages of a time range, its end excluded, in the order of their times."""
        names = [f"/{topic}" for topic in topics]
        for parts in self._reader.iter_messages(topics=names, starting_at=start_ns, ending_before=end_ns):
            yield _recorded(*parts)


@contextmanager
def open_excerpts(path: Path) -> Iterator[Excerpts]:
    """Open a recording for reading in parts.

    Raises
    ------
    ThumperError
        The file cannot be read, is no MCAP file, is damaged, empty or has no index.
    """
    try:
        with path.open("rb") as stream:
            reader = make_reader(stream)
            summary = reader.get_summary()
            if summary is None or summary.statistics is None or not summary.chunk_indexes:
                raise ThumperError(f"{path.name}: it has no index; `thumper recover` writes one")
            yield Excerpts(reader, summary)
    except OSError as error:
        raise ThumperError(f"{path.name}: cannot read it ({error.strerror})") from error
    except (McapError, ZstdError, zlib.error, struct.error, EOFError, ValueError, KeyError) as error:
        raise ThumperError(f"{path.name}: damaged, or not an MCAP file") from error


def _recorded(schema: Schema | None, channel: Channel, message: Message) -> RecordedMessage:
    found = RecordedMessage.of(schema, channel, message)
    if found is None:
        raise ValueError(channel.topic)
    return found
