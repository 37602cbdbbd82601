"""Read recordings, of Thumper and of other ROS 2 programs, message by message in recorded order."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from mcap.records import Channel, Message, Metadata, Schema

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.files import open_regular, unreadable
from thumper.recording.disk_budget import MAGIC
from thumper.recording.mcap_file import PART
from thumper.recording.repair import records_until_error
from thumper.recording.run_metadata import METADATA_NAME, RunMetadata, run_metadata_of
from thumper.ros import codec


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedMessage:
    """One message as stored in the file."""

    topic: str  # without the leading slash
    type_name: str
    log_ns: int
    cdr: bytes
    definition: str = ""  # of the type, as stored in the file

    @classmethod
    def of(cls, schema: Schema | None, channel: Channel | None, message: Message) -> "RecordedMessage | None":
        """Return the message of three MCAP records; None if it is not in CDR, or one is missing."""
        if schema is None or channel is None or channel.message_encoding != "cdr":
            return None
        return cls(
            topic=channel.topic.removeprefix("/"),
            type_name=schema.name,
            log_ns=message.log_time,
            cdr=message.data,
            definition=schema.data.decode("utf-8", errors="replace"),
        )

    def decode(self) -> codec.Message:
        """Decode the message; raises ValueError or KeyError if it is invalid or of an unknown type."""
        return codec.decode(self.cdr, self.type_name, self.definition)


class Recording:
    """One recording: a file, or the files of one run in order."""

    def __init__(self, paths: tuple[Path, ...]) -> None:
        """Check the files. Raises ThumperError if one cannot be read, is not MCAP or of another run."""
        if not paths:
            raise ThumperError(
                "no recording (.mcap) in the folder; pass .mcap files, or a folder of them",
                exit_code=EXIT_USAGE,
            )
        self.paths = paths
        self.notes: list[str] = []  # one line per unreadable part; filled while reading
        for path in paths:
            _check(path)
        self.metadata = _metadata(paths[0])
        first_of_run = {_metadata(path).get("run"): path for path in reversed(paths)}
        if len(first_of_run) > 1:
            last = max(first_of_run.values())
            raise ThumperError(
                f"these files are of {len(first_of_run)} runs; pass those of one run, such as {last}",
                exit_code=EXIT_USAGE,
            )

    @property
    def name(self) -> str:
        """Name of the recording in error texts."""
        return str(self.paths[0])

    def run_metadata(self) -> RunMetadata | None:
        """Return the metadata of the run; None if another program recorded it.

        Raises ThumperError, as `run_metadata_of`.
        """
        return run_metadata_of(self.metadata, self.name) if self.metadata else None

    def messages(self) -> Iterator[RecordedMessage]:
        """Yield all CDR messages, file by file; a truncated file up to its damage, with a note.

        Raises ThumperError if a file unpacks to far more than a recording.
        """
        for path in self.paths:
            yield from self._messages_in(path)

    def _messages_in(self, path: Path) -> Iterator[RecordedMessage]:
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        with path.open("rb") as stream:
            for record in records_until_error(stream):
                if isinstance(record, str):
                    self.notes.append(f"{path.name} {record}")
                elif isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                elif isinstance(record, Message):
                    channel = channels.get(record.channel_id)
                    schema = schemas.get(channel.schema_id) if channel else None
                    found = RecordedMessage.of(schema, channel, record)
                    if found is not None:
                        yield found


def find_recordings(paths: list[Path], report: Callable[[str], None] = print) -> tuple[Path, ...]:
    """Return the given files, and the newest run's recordings in the given folders, by name.

    `report` receives a line for each folder with several runs.

    Raises
    ------
    ThumperError
        The only recording in a folder was never closed.
    """
    found: list[Path] = []
    for path in paths:
        found += _newest_run(path, report) if path.is_dir() else [path]
    unfinished = [part for path in paths for part in sorted(path.glob(f"*.mcap{PART}"))]
    if unfinished and not found:
        raise ThumperError(
            f"{unfinished[0]} is unfinished: it is still being recorded, or a crash left it incomplete; then "
            f"`thumper recover {unfinished[0].parent}` repairs it",
            exit_code=EXIT_USAGE,
        )
    return tuple(found)


def _newest_run(folder: Path, report: Callable[[str], None]) -> list[Path]:
    files = sorted(folder.glob("*.mcap"))
    if len(files) < 2:
        return files
    runs: dict[str | None, list[Path]] = {}
    for path in files:
        _check(path)
        runs.setdefault(_metadata(path).get("run"), []).append(path)
    newest = runs[max(runs, key=lambda run: (len(run or ""), run or ""))]  # numbered by the clock: `Recorder`
    if len(runs) > 1:
        report(f"{folder}/ has recordings of {len(runs)} runs; this is the newest: {newest[0].name}")
    return newest


def is_mcap(path: Path) -> bool:
    """Return whether the file starts like MCAP. Raises OSError."""
    with open_regular(path) as stream:
        return stream.read(len(MAGIC)) == MAGIC


def _check(path: Path) -> None:
    try:
        good = is_mcap(path)
    except OSError as error:
        raise unreadable(path, error) from error
    if not good:
        raise ThumperError(f"{path}: not an MCAP file; is it the right one?", exit_code=EXIT_USAGE)


def _metadata(path: Path) -> dict[str, str]:
    """Return Thumper's metadata, which precedes the first message; empty if there is none."""
    with path.open("rb") as stream:
        for record in records_until_error(stream):
            if isinstance(record, Metadata) and record.name == METADATA_NAME:
                return record.metadata
            if isinstance(record, Message):
                break
    return {}
