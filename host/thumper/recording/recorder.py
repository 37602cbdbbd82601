"""Records what it is given, in a thread of its own; the caller is never delayed and never sees an error."""

import queue
import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path

from thumper.common.stamps import stamp_ns
from thumper.config.recording import RecordingOptions
from thumper.recording.disk_budget import make_room, new_name
from thumper.recording.mcap_file import McapFile
from thumper.recording.run_metadata import METADATA_NAME, RunMetadata
from thumper.ros.codec import Message, encode
from thumper.ros.topics import TOPICS

MB = 1_000_000.0
CLOSE_TIMEOUT_S = 10.0
FLUSH_PERIOD_S = 0.5  # a crash loses at most the messages of this time and one write
QUEUE_SIZE = 4096  # messages that wait for a slow disk, about half a minute of a robot

_Item = tuple[str, str, int, Message | bytes]  # topic, type, log time [ns], the message or its CDR


class Recorder:
    """A queue, a thread that empties it into files, and a word when it had to give up."""

    def __init__(
        self,
        folder: Path,
        session: RunMetadata,
        options: RecordingOptions | None = None,
        *,
        say: Callable[[str], None] = lambda _: None,
        flush_period_s: float = FLUSH_PERIOD_S,
        queue_size: int = QUEUE_SIZE,
    ) -> None:
        """Begin; the thread makes folder and file. `say` is told by it why recording stopped by itself."""
        self._folder, self._session = folder, session
        self._options = options or session.config.recording
        self._say = say
        self._flush_period_s = flush_period_s
        # A quarter at most: else the file that is being written would push out the one just ended.
        self._largest_bytes = min(self._options.file_MB, 0.25 * self._options.budget_MB) * MB
        self._queue: queue.Queue[_Item | None] = queue.Queue(queue_size)
        self._newest_ns = 0
        self._run_ns = time.time_ns()  # what the files of this recording have in common
        self._part = 0
        self._begun_s = 0.0
        self._latched: dict[str, tuple[str, bytes]] = {}  # type and CDR of the newest
        self.dropped = 0
        self.written = 0
        self.trouble = ""
        self._last_word = False
        self.files: list[Path] = []
        self._file: McapFile | None = None
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def __call__(self, topic: str, stamp_s: float, message: Message) -> None:
        """Take one message, `stamp_s` on the host's clock; it must not be changed afterwards."""
        self._put((topic, message.__msgtype__, stamp_ns(stamp_s, self._session.epoch_ns), message))

    def add_cdr(self, topic: str, type_name: str, log_ns: int, cdr: bytes) -> None:
        """Take one message that is bytes already; `log_ns` is since 1970."""
        self._put((topic, type_name, log_ns, cdr))

    @property
    def active(self) -> bool:
        """Whether what comes is recorded; not after the end, nor after trouble."""
        return self._thread.is_alive() and not self.trouble

    def finish(self) -> None:
        """End the recording with what waits; returns at once."""
        try:
            self._queue.put_nowait(None)
        except queue.Full:  # the disk hangs: the thread ends once it has caught up
            self._last_word = True

    def close(self) -> None:
        """End the recording and wait for the file, though not for a disk that hangs. Never raises."""
        self.finish()
        self._thread.join(CLOSE_TIMEOUT_S)

    def _put(self, item: _Item) -> None:
        if self.trouble:
            return
        try:
            self._queue.put_nowait(item)
        except queue.Full:
            self.dropped += 1

    def _run(self) -> None:
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            file = self._begin()
            self._write_until_finished(file)
        except Exception as error:  # in here an error must not pass unheard, nor reach anybody else
            self.trouble = str(error) or type(error).__name__
            if self._file is not None:
                self._file.abandon()
            self._say(f"recording stopped: {self.trouble}; the robot goes on without")

    def _write_until_finished(self, file: McapFile) -> None:
        period_s = self._flush_period_s
        due_s = time.monotonic() + period_s
        while not (self._last_word and self._queue.empty()):
            try:
                item = self._queue.get(timeout=max(0.0, due_s - time.monotonic()))
                if item is None:
                    break
                self._write(file, item)
            except queue.Empty:
                pass
            if time.monotonic() >= due_s:
                file.flush()
                file = self._within_limits(file)
                due_s = time.monotonic() + period_s
        file.close()

    def _write(self, file: McapFile, item: _Item) -> None:
        topic, type_name, log_ns, message = item
        self._newest_ns = max(self._newest_ns, log_ns)  # a file is read in the order of its times
        cdr = message if isinstance(message, bytes) else encode(message)
        if topic in TOPICS and TOPICS[topic].latched:
            self._latched[topic] = (type_name, cdr)
        file.add(topic, type_name, self._newest_ns, cdr)
        self.written += 1

    def _within_limits(self, file: McapFile) -> McapFile:
        """The file to go on with: this one, or the next."""
        options = self._options
        if shutil.disk_usage(self._folder).free < options.spare_MB * MB:
            raise OSError(f"less than {options.spare_MB:.0f} MB are free on the disk; delete something")
        old = time.monotonic() - self._begun_s > options.file_s
        if file.bytes_written <= self._largest_bytes and not old:
            return file
        file.close()
        file = self._begin()
        for topic, (type_name, cdr) in self._latched.items():  # each file is understood by itself
            file.add(topic, type_name, self._newest_ns, cdr)
        return file

    def _begin(self) -> McapFile:
        self._begun_s = time.monotonic()
        path = new_name(self._folder, self._session.config.name, self._part)
        self._part += 1
        place = {"run": str(self._run_ns), "part": str(self._part - 1)}
        metadata = {METADATA_NAME: self._session.as_metadata() | place}
        self.files.append(path)
        make_room(
            self._folder,
            self._session.config.name,
            budget_bytes=self._options.budget_MB * MB,
            reserve_bytes=self._largest_bytes,
        )
        self._file = McapFile(path, metadata)
        return self._file
