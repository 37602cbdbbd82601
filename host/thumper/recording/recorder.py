"""Record messages in a separate thread; the caller never waits and never sees an error.

While the disk is full, recording pauses: what is written stays, and a new file begins once there is room.
"""

import queue
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path

from thumper.common.stamps import stamp_ns
from thumper.config.recording import RecordingOptions
from thumper.recording.disk_budget import check_room, is_full, make_room, new_name
from thumper.recording.mcap_file import McapFile
from thumper.recording.run_metadata import METADATA_NAME, RunMetadata
from thumper.ros.codec import Message, encode
from thumper.ros.topics import TOPICS

MB = 1_000_000.0
CLOSE_TIMEOUT_S = 10.0
FLUSH_PERIOD_S = 0.5  # a crash loses at most the messages of this time and one write
ROOM_PERIOD_S = 2.0  # between checks whether a full disk has room again
QUEUE_SIZE = 4096  # messages that wait for a slow disk, about half a minute of a robot

_Item = tuple[str, str, int | None, Message | bytes]
"""Topic, type, log time [ns] if the message has one, and the message or its CDR."""


class Recorder:
    """Queues messages; its thread writes them to files, and reports if it has to pause or stop."""

    def __init__(
        self,
        folder: Path,
        run: RunMetadata,
        options: RecordingOptions | None = None,
        *,
        report: Callable[[str], None] = lambda _: None,
        flush_period_s: float = FLUSH_PERIOD_S,
        queue_size: int = QUEUE_SIZE,
    ) -> None:
        """Start the thread, which creates the files and calls `report` if recording pauses or stops."""
        self._folder, self._run_metadata = folder, run
        self._options = options or run.config.recording
        self._report = report
        self._flush_period_s = flush_period_s
        # At most a quarter of the budget: else the open file would evict the one just finished.
        self._max_file_bytes = min(self._options.file_MB, 0.25 * self._options.budget_MB) * MB
        self._queue: queue.Queue[_Item | None] = queue.Queue(queue_size)
        self._newest_ns: int | None = None  # log time of the newest message
        self._untimed: list[_Item] = []  # before the first message that has a time
        self._run_id = time.time_ns()  # common to the files of this recording
        self._part = 0
        self._file_start_s = 0.0
        self._latched: dict[str, tuple[str, bytes]] = {}  # type and CDR of the newest
        self.is_paused = False  # the disk is full
        self.dropped = 0  # no place in the queue or on the disk, or received while paused
        self.written = 0
        self._unflushed = 0  # how many of those written are not yet safe on the disk
        self.failure = ""
        self._finish_requested = False
        self.files: list[Path] = []
        self._file: McapFile | None = None
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def __call__(self, topic: str, stamp_s: float, message: Message) -> None:
        """Queue one message, `stamp_s` on the host's clock. The caller must not change it afterwards."""
        if TOPICS[topic].recorded:
            self._put((topic, message.__msgtype__, stamp_ns(stamp_s, self._run_metadata.epoch_ns), message))

    def add_cdr(self, topic: str, type_name: str, log_ns: int | None, cdr: bytes) -> None:
        """Queue one message that is already encoded; `log_ns` counts from 1970.

        None means the time of the message before it, or at the start of the recording, of the one after it.
        """
        self._put((topic, type_name, log_ns, cdr))

    @property
    def active(self) -> bool:
        """Whether messages are recorded: not after the end, nor after a failure."""
        return self._thread.is_alive() and not self.failure

    def finish(self) -> None:
        """End the recording after the queued messages; returns at once."""
        try:
            self._queue.put_nowait(None)
        except queue.Full:  # the disk hangs: the thread ends once the queue is empty
            self._finish_requested = True

    def close(self) -> None:
        """End the recording and wait for the file, at most 10 s if the disk hangs. Never raises."""
        self.finish()
        self._thread.join(CLOSE_TIMEOUT_S)

    def _put(self, item: _Item) -> None:
        if self.failure:
            return
        try:
            self._queue.put_nowait(item)
        except queue.Full:
            self.dropped += 1

    def _run(self) -> None:
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            while not self._record():
                if not self._wait_for_room():
                    return
        except Exception as error:  # report any error, but never pass it on to the robot
            self.failure = str(error) or type(error).__name__
            self._abandon()
            self._report(f"recording stopped: {self.failure}; the robot continues without it")

    def _record(self) -> bool:
        """Write messages until the end; return False if the disk is full."""
        try:
            self._write_until_finished(self._open_file())
        except OSError as error:
            self._abandon()
            if not is_full(error):
                raise
            self.dropped += self._unflushed  # they were in the buffer that found no room
            self.written -= self._unflushed
            self._unflushed = 0
            if not self.is_paused:
                self.is_paused = True
                self._report(f"recording paused: {error.strerror}; it continues when there is room")
            return False
        return True

    def _wait_for_room(self) -> bool:
        """Drop messages until there may be room again; return False if the recording ends before that."""
        due_s = time.monotonic() + ROOM_PERIOD_S
        while not (self._finish_requested and self._queue.empty()):
            try:
                item = self._queue.get(timeout=max(0.0, due_s - time.monotonic()))
            except queue.Empty:
                item = ("", "", None, b"")
            if item is None:
                break
            if item[0]:
                self._drop(item)
            if time.monotonic() >= due_s:
                return True
        self.failure = "the disk is full"
        return False

    def _drop(self, item: _Item) -> None:
        topic, type_name, _, message = item
        self.dropped += 1
        if topic in TOPICS and TOPICS[topic].latched:  # for the next file
            self._latched[topic] = (type_name, message if isinstance(message, bytes) else encode(message))

    def _abandon(self) -> None:
        if self._file is not None:
            self._file.abandon()
            self._file = None

    def _write_until_finished(self, file: McapFile) -> None:
        period_s = self._flush_period_s
        due_s = time.monotonic() + period_s
        while not (self._finish_requested and self._queue.empty()):
            try:
                item = self._queue.get(timeout=max(0.0, due_s - time.monotonic()))
                if item is None:
                    break
                self._write(file, item)
            except queue.Empty:
                pass
            if time.monotonic() >= due_s:
                file.flush()
                self._unflushed = 0
                file = self._within_limits(file)
                self._report_end_of_pause()
                due_s = time.monotonic() + period_s
        self._write_at(file, self._newest_ns or self._run_metadata.epoch_ns, self._untimed)
        file.close()

    def _write(self, file: McapFile, item: _Item) -> None:
        log_ns = item[2]
        if log_ns is not None:
            self._newest_ns = max(self._newest_ns or log_ns, log_ns)  # readers expect increasing times
        elif self._newest_ns is None:
            self._untimed.append(item)
            return
        self._write_at(file, self._newest_ns, (*self._untimed, item))
        self._untimed.clear()

    def _write_at(self, file: McapFile, log_ns: int, items: Iterable[_Item]) -> None:
        for topic, type_name, _, message in items:
            cdr = message if isinstance(message, bytes) else encode(message)
            if topic in TOPICS and TOPICS[topic].latched:
                self._latched[topic] = (type_name, cdr)
            self.written += 1
            self._unflushed += 1
            file.add(topic, type_name, log_ns, cdr)

    def _within_limits(self, file: McapFile) -> McapFile:
        """Return the file to continue with: this one, or a new one if a limit is reached."""
        options = self._options
        try:
            check_room(self._folder, options.spare_MB * MB)
        except OSError:
            file.close()  # while there is still room for its index
            self._file = None
            raise
        is_old = time.monotonic() - self._file_start_s > options.file_s
        if file.bytes_written <= self._max_file_bytes and not is_old:
            return file
        file.close()
        return self._open_file()

    def _report_end_of_pause(self) -> None:
        if self.is_paused:
            self.is_paused = False
            self._report(f"recording continues; {self.dropped} messages are missing")

    def _open_file(self) -> McapFile:
        self._file_start_s = time.monotonic()
        path = new_name(self._folder, self._run_metadata.config.name, self._part)
        self._part += 1
        position = {"run": str(self._run_id), "part": str(self._part - 1)}
        metadata = {METADATA_NAME: self._run_metadata.as_metadata() | position}
        make_room(
            self._folder,
            self._run_metadata.config.name,
            budget_bytes=self._options.budget_MB * MB,
            reserve_bytes=self._max_file_bytes,
        )
        check_room(self._folder, self._options.spare_MB * MB)
        self._file = McapFile(path, metadata)
        self.files.append(path)
        for topic, (type_name, cdr) in self._latched.items():  # each file is self-contained
            self._file.add(topic, type_name, self._newest_ns or 0, cdr)
        return self._file
