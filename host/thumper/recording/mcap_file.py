"""Write one MCAP file of ROS 2 messages (profile `ros2`, schemas `ros2msg`, encoding CDR).

While the file is open, its name ends in `.part` and it is locked. A `.part` file without a lock is left
from a crash. Format: https://mcap.dev/spec
"""

import fcntl
import os
from pathlib import Path
from typing import IO

from mcap.writer import CompressionType, Writer

from thumper.common.files import sync_folder
from thumper.common.version import __version__
from thumper.ros.codec import definition

PART = ".part"
LIBRARY = f"thumper {__version__}"
CHUNK_BYTES = 256 * 1024  # the most that one flush writes at once


class McapFile:
    """Writer: `add` appends, `flush` makes it safe on the disk, `close` gives the file its final name."""

    def __init__(self, path: Path, metadata: dict[str, dict[str, str]]) -> None:
        """Create `path` with the metadata. Raises OSError, also if the file exists."""
        self.path = path
        self._part = path.with_name(path.name + PART)
        self._stream: IO[bytes] = self._part.open("xb")
        fcntl.flock(self._stream, fcntl.LOCK_EX)  # blocks briefly while another process tests the lock
        self._writer = Writer(self._stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        try:
            self._writer.start(profile="ros2", library=LIBRARY)
            for name, content in metadata.items():
                self._writer.add_metadata(name, content)
            self.flush()
        except OSError:
            self.abandon()
            self._part.unlink()  # it has nothing yet
            raise

    @property
    def bytes_written(self) -> int:
        """Size of the file on the disk."""
        return self._stream.tell()

    def add(self, topic: str, type_name: str, log_ns: int, cdr: bytes) -> None:
        """Append one message; it is written at the next flush, or once a chunk is full."""
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._channels[topic] = self._register(topic, type_name)
        count = self._counts[topic] = self._counts.get(topic, -1) + 1
        self._writer.add_message(
            channel_id=channel, log_time=log_ns, publish_time=log_ns, data=cdr, sequence=count
        )

    def flush(self) -> None:
        """Write everything to the disk."""
        self._writer.flush()
        os.fsync(self._stream.fileno())

    def close(self) -> None:
        """Write the index and give the file its final name."""
        self._writer.finish()
        self._stream.flush()
        os.fsync(self._stream.fileno())
        self._part.rename(self.path)
        sync_folder(self.path.parent)
        self._stream.close()

    def abandon(self) -> None:
        """Close the file as it is, because the disk is full or broken. Never raises."""
        try:
            self._stream.close()
        except OSError:  # the buffer cannot be written; the file is closed nevertheless
            return

    def _register(self, topic: str, type_name: str) -> int:
        schema = self._schemas.get(type_name)
        if schema is None:
            text = definition(type_name).encode()
            schema = self._writer.register_schema(name=type_name, encoding="ros2msg", data=text)
            self._schemas[type_name] = schema
        return self._writer.register_channel(topic=f"/{topic}", message_encoding="cdr", schema_id=schema)
