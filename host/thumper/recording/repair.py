"""Repair recordings that a crash left incomplete: copy them up to the first error and write an index."""

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
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.files import open_regular, sync_folder, unreadable
from thumper.recording.chunks import ChunkReader
from thumper.recording.mcap_file import CHUNK_BYTES, LIBRARY, PART

DAMAGED = ".damaged"
REPAIRED = ".repaired"  # while the repaired file is being written


@dataclass(frozen=True, slots=True, kw_only=True)
class RepairResult:
    """Result of one repair."""

    path: Path  # of the repaired file
    messages: int
    note: str  # what was lost; empty: nothing


def unfinished_recordings(folder: Path) -> list[Path]:
    """Return the unfinished recordings in the folder that no running program holds, oldest first."""
    return [path for path in sorted(folder.glob(f"*.mcap{PART}")) if path.is_file() and not _is_locked(path)]


def repair(path: Path) -> RepairResult | None:
    """Repair the file; return None if it is complete already.

    `X.mcap.part` becomes `X.mcap`. A damaged `X.mcap` is replaced by the repaired file and kept as
    `X.mcap.damaged`. The original is deleted only once the new file is on the disk.

    Raises
    ------
    ThumperError
        It cannot be read or written, is not an MCAP file, unpacks to far more than one, or a running program
        is writing it.
    """
    unfinished = path.name.endswith(PART)
    target = _unused_name(path.with_name(path.name.removesuffix(PART))) if unfinished else path
    try:
        if not unfinished and is_complete(path):
            return None
        repaired = target.with_name(target.name + REPAIRED)
        with open_regular(path) as source:
            if not _lock(source):  # held until closed, so that two programs never repair the same file
                raise ThumperError(
                    f"{path}: another program is recording or repairing it; stop that program first",
                    exit_code=EXIT_USAGE,
                )
            profile = _profile(path)
            try:
                with repaired.open("wb") as sink:
                    messages, note = _copy(source, sink, profile)
                    sink.flush()
                    os.fsync(sink.fileno())
            except BaseException:
                repaired.unlink()
                raise
            if not unfinished:
                path.rename(_unused_name(path.with_name(path.name + DAMAGED)))
            repaired.rename(target)
            sync_folder(target.parent)
            if unfinished:
                path.unlink()
    except OSError as error:
        raise ThumperError(
            f"{path}: cannot repair it ({error}); the file is kept", exit_code=EXIT_USAGE
        ) from error
    return RepairResult(path=target, messages=messages, note=note)


def repair_all(paths: Iterable[Path], report: Callable[[str], None]) -> list[ThumperError]:
    """Repair the files, `report` each that is complete now, and return why others are not."""
    failures = []
    for path in paths:
        try:
            if path.stat().st_size == 0 and path.name.endswith(PART):  # the crash preceded the first byte
                path.unlink()
            elif result := repair(path):
                lost = f" ({result.note})" if result.note else ""
                report(f"{result.path}: repaired, {result.messages} messages{lost}")
            else:
                report(f"{path}: complete already")
        except ThumperError as error:
            failures.append(error)
        except OSError as error:
            failures.append(unreadable(path, error))
    return failures


def repair_in_subprocess(folder: Path) -> None:
    """Start a process that repairs incomplete recordings in the folder, so that the robot need not wait."""
    if folder.is_dir() and (paths := unfinished_recordings(folder)):
        command = [sys.executable, "-m", "thumper", "recover", *map(str, paths)]
        subprocess.Popen(["nice", *command], start_new_session=True)  # Ctrl-C must not end it


def is_complete(path: Path) -> bool:
    """Return whether the file is complete, so that readers find its index."""
    try:
        with open_regular(path) as stream:
            return SeekingReader(stream).get_summary() is not None
    except OSError:
        raise
    except Exception:  # a damaged file can raise anything in the reader
        return False


def records_until_error(stream: IO[bytes]) -> Iterator[McapRecord | str]:
    """Yield records up to the first error, chunks unpacked; a text describes what could not be read.

    A damaged record may claim any length, so none may exceed the size of the file. A chunk with a wrong
    checksum is skipped: its length is still valid, so the next record follows it.

    Raises
    ------
    ThumperError
        The file unpacks to far more than a recording.
    """
    size = os.fstat(stream.fileno()).st_size
    reader = StreamReader(stream, emit_chunks=True, record_size_limit=size)
    chunks = ChunkReader(stream.name, size)
    records = iter(reader.records)
    while True:
        try:
            record = next(records)
        except StopIteration:
            return
        except Exception as error:  # truncated, or not MCAP from here on
            where = f"byte {stream.tell()} of {size}"
            yield f"ends early: unreadable from {where} ({type(error).__name__})"
            return
        if not isinstance(record, Chunk):
            yield record
            continue
        try:
            yield from chunks.records(record)
        except ThumperError:
            raise
        except Exception as error:
            yield f"a chunk is damaged and skipped ({type(error).__name__})"


def _profile(path: Path) -> str:
    """Return the profile in the file's first record."""
    with open_regular(path) as stream:
        try:
            header = next(iter(StreamReader(stream, record_size_limit=path.stat().st_size).records))
        except OSError:
            raise
        except Exception as error:  # invalid bytes can raise anything in the reader
            raise ThumperError(
                f"{path}: not an MCAP file; is it the right one?", exit_code=EXIT_USAGE
            ) from error
    return header.profile if isinstance(header, Header) else ""


def _copy(source: IO[bytes], sink: IO[bytes], profile: str) -> tuple[int, str]:
    writer = Writer(sink, chunk_size=CHUNK_BYTES)
    writer.start(profile=profile, library=f"{LIBRARY} recover")
    schemas: dict[int, int] = {0: 0}
    channels: dict[int, int] = {}
    messages, notes = 0, []
    for record in records_until_error(source):
        if isinstance(record, str):
            notes.append(record)
        elif isinstance(record, (DataEnd, Footer)):
            break  # the index follows; the writer makes a new one
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


def _is_locked(path: Path) -> bool:
    with open_regular(path) as stream:
        return not _lock(stream)


def _lock(stream: IO[bytes]) -> bool:
    """Lock the file while the stream is open; return False if another program has locked it."""
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _unused_name(path: Path) -> Path:
    """Return the path, with a number if it exists: no file is ever overwritten."""
    number, free = 1, path
    while free.exists():
        free = path.with_name(f"{path.stem}-{number}{path.suffix}")
        number += 1
    return free
