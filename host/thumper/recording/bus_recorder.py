"""Record a robot over the bus, and replay a recording on a bus."""

import json
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from thumper.bus.client import BusClient
from thumper.bus.server import BusServer
from thumper.bus.status_watchdog import StatusWatchdog
from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.common.stamps import NS_PER_S
from thumper.config.bus import BusOptions
from thumper.config.recording import RecordingOptions
from thumper.config.robot import RobotConfig
from thumper.recording.reader import RecordedMessage, Recording
from thumper.recording.recorder import Recorder
from thumper.recording.replay import ReplayResult, replay
from thumper.recording.run_metadata import run_metadata_of
from thumper.ros.codec import Message, encode
from thumper.ros.to_ros import map_change
from thumper.ros.topics import TOPICS, Direction
from thumper.runtime.service.request_queue import RequestQueue

SESSION_TIMEOUT_S = 3.0
CHECK_PERIOD_S = 0.2
STAMP = slice(4, 12)  # position of the stamp in CDR: after the 4-byte header
FIRST_STAMP = slice(8, 16)  # the same in the first element of a list, after the list's length


class BusRecording:
    """Records the runs of one robot: a restarted robot starts a new recording."""

    def __init__(
        self, client: BusClient, folder: Path, options: RecordingOptions, report: Callable[[str], None]
    ) -> None:
        """Subscribe to all topics. Raises ThumperError if the robot sends no usable run metadata."""
        self._folder, self._options, self._report = folder, options, report
        self._session = ""  # the run metadata of the newest recorder
        self._is_paused = True  # until it is known of which run the messages are
        self._problem: ThumperError | None = None
        self._has_session = threading.Event()
        self.recorders: list[Recorder] = []
        client.on_lost(self._on_lost)
        client.subscribe("session", self._on_session)  # first: the topics after it belong to its run
        if not self._has_session.wait(SESSION_TIMEOUT_S):
            raise ThumperError(
                "the robot does not publish its run metadata; is it running, under this name?",
                exit_code=EXIT_NOT_THERE,
            )
        self.check()
        for name, topic in TOPICS.items():
            if topic.direction is Direction.IN or not topic.recorded or name == "session":
                continue
            if topic.latched:  # subscribe_raw would not fetch the newest message
                client.subscribe(name, self._sink(name, topic.type_name))
            else:
                client.subscribe_raw(name, self._raw_sink(name, topic.type_name))

    def check(self) -> bool:
        """Return whether messages are recorded; raises ThumperError if the robot's run cannot be."""
        if self._problem is not None:
            raise self._problem
        return self.recorders[-1].active

    def close(self) -> None:
        """Finish all files."""
        self._is_paused = True
        for recorder in self.recorders:
            recorder.close()

    def _on_lost(self) -> None:
        self._is_paused = True

    def _on_session(self, message: Message) -> None:
        if message.data != self._session:  # else the connection was lost, not the robot
            self._session = message.data
            try:
                self._start(message)
            except ThumperError as error:
                self._problem = error
        self._is_paused = self._problem is not None
        self._has_session.set()

    def _start(self, message: Message) -> None:
        try:
            run = run_metadata_of(json.loads(message.data), "the running robot")
        except ValueError as error:
            raise ThumperError(f"cannot read the robot's run metadata: {error}") from error
        if self.recorders:
            self.recorders[-1].finish()
            self._report("the robot has restarted: a new recording starts")
        recorder = Recorder(self._folder, replace(run, from_start=False), self._options, report=self._report)
        recorder.add_cdr("session", TOPICS["session"].type_name, None, encode(message))
        self.recorders.append(recorder)

    def _sink(self, name: str, type_name: str) -> Callable[[Message], None]:
        """Return a sink for a latched topic. Its stamp may be hours older than the recording: ignore it."""
        return lambda message: self._add(name, type_name, None, encode(message))

    def _raw_sink(self, name: str, type_name: str) -> Callable[[bytes], None]:
        return lambda cdr: self._add(name, type_name, _stamp_ns(type_name, cdr), cdr)

    def _add(self, name: str, type_name: str, log_ns: int | None, cdr: bytes) -> None:
        if not self._is_paused:
            self.recorders[-1].add_cdr(name, type_name, log_ns, cdr)


def record_from_bus(
    client: BusClient,
    folder: Path,
    options: RecordingOptions,
    *,
    seconds: float | None,
    report: Callable[[str], None],
) -> list[Recorder]:
    """Record all topics until Ctrl-C, for `seconds`, or until recording fails; return a recorder per run.

    Raises
    ------
    ThumperError
        No robot answers, or it is of another version.
    """
    recording = BusRecording(client, folder, options, report)
    try:
        until_s = time.monotonic() + seconds if seconds is not None else None
        watchdog = StatusWatchdog(client, report)
        while recording.check() and (until_s is None or time.monotonic() < until_s):
            watchdog.check()
            time.sleep(CHECK_PERIOD_S)
    except KeyboardInterrupt:
        pass
    finally:
        recording.close()
    return recording.recorders


def replay_on_bus(
    recording: Recording, config: RobotConfig | None, address: str, speed: float
) -> ReplayResult:
    """Replay at `speed` times real time, and publish every message on a bus at `address`.

    Raises
    ------
    ThumperError
        As `replay`, or the address is in use or not valid.
    """
    run = recording.run_metadata()
    name = run.config.name if run else "replay"
    server = BusServer(name, BusOptions().at(address), RequestQueue(), lambda _: None)

    def publish(recorded: RecordedMessage, message: Message) -> None:
        if TOPICS[recorded.topic].direction is Direction.OUT:
            server.publish(recorded.topic, 0.0, message)
        if recorded.topic == "map":
            server.publish("map_changes", 0.0, map_change(None, message, None))

    try:
        return replay(recording, config, on_message=publish, speed=speed)
    finally:
        server.close()


def _stamp_ns(type_name: str, cdr: bytes) -> int | None:
    """Return the stamp of the message, of a transform message that of its first; None if it has none."""
    stamp = cdr[STAMP]
    if type_name == "tf2_msgs/msg/TFMessage":
        stamp = cdr[FIRST_STAMP]
    if type_name == "std_msgs/msg/String" or len(stamp) < STAMP.stop - STAMP.start:
        return None
    return int.from_bytes(stamp[:4], "little", signed=True) * NS_PER_S + int.from_bytes(stamp[4:], "little")
