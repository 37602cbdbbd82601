"""Recordings as messages again, in the order they were said; own ones and those of other ROS 2 programs."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mcap.records import Channel, Message, Metadata, Schema

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.recording.disk_budget import MAGIC
from thumper.recording.mcap_file import PART
from thumper.recording.repair import records_until_error
from thumper.recording.run_metadata import METADATA_NAME, RunMetadata, session_of
from thumper.ros import codec


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedMessage:
    """One message as it lies in the file."""

    topic: str  # without the slash before it
    type_name: str
    log_ns: int
    cdr: bytes

    def message(self) -> codec.Message:
        """Decode it; raises ValueError or KeyError when it is of no type known here."""
        return codec.decode(self.cdr, self.type_name)


class Recording:
    """One recording: a file, or the files of one run in their order."""

    def __init__(self, paths: tuple[Path, ...]) -> None:
        """Look into the files. Raises ThumperError when one cannot be read, is no MCAP or another run's."""
        if not paths:
            raise ThumperError(
                "no recording: give .mcap files, or a folder that holds them", exit_code=EXIT_USAGE
            )
        self.paths = paths
        self.notes: list[str] = []  # what could not be read, a line each; filled while reading
        for path in paths:
            _check(path)
        self.metadata = _metadata(paths[0])
        for path in paths[1:]:
            if _metadata(path).get("run") != self.metadata.get("run"):
                raise ThumperError(
                    f"{path} is of another run than {paths[0]}: give the files of one run",
                    exit_code=EXIT_USAGE,
                )

    @property
    def name(self) -> str:
        """What messages call it."""
        return str(self.paths[0])

    def session(self) -> RunMetadata | None:
        """What the run was; None when another program recorded it. Raises ThumperError, as `session_of`."""
        return session_of(self.metadata, self.name) if self.metadata else None

    def said(self) -> Iterator[RecordedMessage]:
        """All CDR messages, file by file; a torn file to where it is torn, with a note."""
        for path in self.paths:
            yield from self._said_in(path)

    def _said_in(self, path: Path) -> Iterator[RecordedMessage]:
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        with path.open("rb") as stream:
            for record in records_until_error(stream, os.fstat(stream.fileno()).st_size):
                if isinstance(record, str):
                    self.notes.append(f"{path.name} {record}")
                elif isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                elif isinstance(record, Message):
                    channel = channels.get(record.channel_id)
                    schema = schemas.get(channel.schema_id) if channel else None
                    if channel is None or schema is None or channel.message_encoding != "cdr":
                        continue
                    yield RecordedMessage(
                        topic=channel.topic.removeprefix("/"),
                        type_name=schema.name,
                        log_ns=record.log_time,
                        cdr=record.data,
                    )


def find_recordings(places: list[Path]) -> tuple[Path, ...]:
    """The files themselves, and of folders the recordings in them, by name.

    Raises
    ------
    ThumperError
        There is none but in a folder one that was never closed.
    """
    found: list[Path] = []
    for place in places:
        found += sorted(place.glob("*.mcap")) if place.is_dir() else [place]
    open_still = [part for place in places for part in sorted(place.glob(f"*.mcap{PART}"))]
    if open_still and not found:
        raise ThumperError(
            f"{open_still[0]} is not closed: it is being recorded, or a crash has torn it; then "
            f"`thumper recover {open_still[0].parent}` makes it whole",
            exit_code=EXIT_USAGE,
        )
    return tuple(found)


def is_mcap(path: Path) -> bool:
    """Whether the file begins like one. Raises OSError."""
    with path.open("rb") as stream:
        return stream.read(len(MAGIC)) == MAGIC


def _check(path: Path) -> None:
    try:
        good = is_mcap(path)
    except OSError as error:
        raise ThumperError(
            f"{path}: cannot be read ({error.strerror}); check the path", exit_code=EXIT_USAGE
        ) from error
    if not good:
        raise ThumperError(f"{path}: no MCAP file; is it the right one?", exit_code=EXIT_USAGE)


def _metadata(path: Path) -> dict[str, str]:
    """Our own metadata; it stands before the first message."""
    with path.open("rb") as stream:
        for record in records_until_error(stream, os.fstat(stream.fileno()).st_size):
            if isinstance(record, Metadata) and record.name == METADATA_NAME:
                return record.metadata
            if isinstance(record, Message):
                break
    return {}
