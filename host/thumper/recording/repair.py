"""Recordings that a crash left behind, made whole: read to the first error, written anew with an index."""

import fcntl
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from mcap.reader import SeekingReader
from mcap.records import (
    Attachment,
    Channel,
    Chunk,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    Metadata,
    Schema,
)
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import Writer

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.recording.mcap_file import CHUNK_BYTES, LIBRARY, PART, sync_folder

DAMAGED = ".damaged"
REPAIRED = ".repaired"  # while the repaired file is being written


@dataclass(frozen=True, slots=True, kw_only=True)
class Repair:
    """What came of one file."""

    path: Path  # the whole file
    messages: int
    note: str  # what was lost, or nothing


def left_behind(folder: Path) -> list[Path]:
    """The unfinished recordings in the folder that no living program holds, oldest first."""
    return [path for path in sorted(folder.glob(f"*.mcap{PART}")) if not _is_held(path)]


def recover(path: Path) -> Repair | None:
    """Make the file whole; None when it is already. The original goes only once the new file is on the disk.

    `X.mcap.part` becomes `X.mcap`. A damaged `X.mcap` is repaired in its place and kept as `X.mcap.damaged`.

    Raises
    ------
    ThumperError
        It cannot be read or written, is no MCAP file at all, or is being written by a running program.
    """
    unfinished = path.name.endswith(PART)
    target = _free(path.with_name(path.name.removesuffix(PART))) if unfinished else path
    try:
        if not unfinished and is_whole(path):
            return None
        repaired = target.with_name(target.name + REPAIRED)
        with path.open("rb") as source:
            if not _take(source):  # and hold it: two that repair the same file would write into one
                raise ThumperError(
                    f"{path}: is being recorded or repaired just now; stop that program first",
                    exit_code=EXIT_USAGE,
                )
            profile = _profile(path)
            with repaired.open("wb") as sink:
                messages, note = _copy(source, sink, profile)
                sink.flush()
                os.fsync(sink.fileno())
            if not unfinished:
                path.rename(_free(path.with_name(path.name + DAMAGED)))
            repaired.rename(target)
            sync_folder(target.parent)
            if unfinished:
                path.unlink()
    except OSError as error:
        raise ThumperError(
            f"{path}: cannot be repaired ({error}); the file is kept", exit_code=EXIT_USAGE
        ) from error
    return Repair(path=target, messages=messages, note=note)


def recover_all(paths: Iterable[Path], say: Callable[[str], None]) -> bool:
    """Repair one after another; `say` is told of each. Returns whether all are whole now. Never raises."""
    good = True
    for path in paths:
        try:
            if path.stat().st_size == 0 and path.name.endswith(PART):  # the crash came before the first byte
                path.unlink()
            elif repair := recover(path):
                lost = f" ({repair.note})" if repair.note else ""
                say(f"{repair.path}: repaired, {repair.messages} messages{lost}")
            else:
                say(f"{path}: whole already")
        except ThumperError as error:
            say(str(error))
            good = False
        except OSError as error:
            say(f"{path}: cannot be read ({error.strerror}); check the path")
            good = False
    return good


def recover_apart(folder: Path) -> None:
    """Repair what crashes left in the folder, in a process of its own: a robot's loop must not wait."""
    if folder.is_dir() and (paths := left_behind(folder)):
        command = [sys.executable, "-m", "thumper", "recover", *map(str, paths)]
        subprocess.Popen(["nice", *command], start_new_session=True)  # Ctrl-C is not meant for it


def is_whole(path: Path) -> bool:
    """Whether the file ends as a finished one does: readers that look for the index will find it."""
    try:
        with path.open("rb") as stream:
            return SeekingReader(stream).get_summary() is not None
    except OSError:
        raise
    except Exception:  # whatever a broken file makes the reader stumble over
        return False


def records_until_error(stream: IO[bytes], size: int) -> Iterator[McapRecord | str]:
    """Yield records as far as they can be read, chunks unpacked; a text says what could not be.

    A torn record may promise any length: none may be longer than the file. A chunk whose checksum is wrong
    is left out, for the next record begins where it says.
    """
    reader = StreamReader(stream, emit_chunks=True, record_size_limit=size)
    records = iter(reader.records)
    while True:
        try:
            record = next(records)
        except StopIteration:
            return
        except Exception as error:  # cut off, or no MCAP from here on
            where = f"byte {stream.tell()} of {size}"
            yield f"ends early: nothing can be read beyond {where} ({type(error).__name__})"
            return
        if not isinstance(record, Chunk):
            yield record
            continue
        try:
            yield from breakup_chunk(record, validate_crc=True)
        except Exception as error:
            yield f"a chunk is damaged and left out ({type(error).__name__})"


def _profile(path: Path) -> str:
    """The profile that the file's first record names."""
    with path.open("rb") as stream:
        try:
            header = next(iter(StreamReader(stream, record_size_limit=path.stat().st_size).records))
        except OSError:
            raise
        except Exception as error:  # whatever such bytes lead the reader to
            raise ThumperError(f"{path}: no MCAP file; is it the right one?", exit_code=EXIT_USAGE) from error
    return header.profile if isinstance(header, Header) else ""


def _copy(source: IO[bytes], sink: IO[bytes], profile: str) -> tuple[int, str]:
    size = os.fstat(source.fileno()).st_size
    writer = Writer(sink, chunk_size=CHUNK_BYTES)
    writer.start(profile=profile, library=f"{LIBRARY} recover")
    schemas: dict[int, int] = {0: 0}
    channels: dict[int, int] = {}
    messages, notes = 0, []
    for record in records_until_error(source, size):
        if isinstance(record, str):
            notes.append(record)
        elif isinstance(record, (DataEnd, Footer)):
            break  # what follows is the index, which is made anew
        elif isinstance(record, Schema) and record.id not in schemas:
            schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
        elif isinstance(record, Channel) and record.id not in channels and record.schema_id in schemas:
            channels[record.id] = writer.register_channel(
                record.topic, record.message_encoding, schemas[record.schema_id], record.metadata
            )
        elif isinstance(record, Message) and record.channel_id in channels:
            writer.add_message(
                channels[record.channel_id],
                record.log_time,
                record.data,
                record.publish_time,
                record.sequence,
            )
            messages += 1
        elif isinstance(record, Metadata):
            writer.add_metadata(record.name, record.metadata)
        elif isinstance(record, Attachment):
            writer.add_attachment(
                record.create_time, record.log_time, record.name, record.media_type, record.data
            )
    writer.finish()
    return messages, "; ".join(notes)


def _is_held(path: Path) -> bool:
    with path.open("rb") as stream:
        return not _take(stream)


def _take(stream: IO[bytes]) -> bool:
    """Hold the file for as long as the stream is open; False when another program does."""
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _free(path: Path) -> Path:
    """This name, or it with a number: nothing is ever overwritten."""
    number, free = 1, path
    while free.exists():
        free = path.with_name(f"{path.stem}-{number}{path.suffix}")
        number += 1
    return free
