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
from thumper.recording.run_metadata import RunMetadata, run_metadata_of
from thumper.ros.codec import Message, encode
from thumper.ros.topics import TOPICS, Direction
from thumper.runtime.service.request_queue import RequestQueue

SESSION_TIMEOUT_S = 3.0
CHECK_PERIOD_S = 0.2
STAMP = slice(4, 12)  # position of the stamp in CDR: after the 4-byte header


def record_from_bus(
    client: BusClient,
    folder: Path,
    options: RecordingOptions,
    *,
    seconds: float | None,
    report: Callable[[str], None],
) -> Recorder:
    """Record all topics until Ctrl-C, for `seconds`, or until recording fails; return the recorder.

    Raises
    ------
    ThumperError
        No robot answers, it is of another version, or it stops publishing.
    """
    recorder = Recorder(folder, _query_metadata(client), options, report=report)
    try:
        for name, topic in TOPICS.items():
            if topic.direction is Direction.IN:
                continue
            if topic.latched:  # subscribe_raw would not fetch the newest message
                client.subscribe(name, _add_message(recorder, name, topic.type_name))
            else:
                client.subscribe_raw(name, _add_raw(recorder, name, topic.type_name))
        until_s = time.monotonic() + seconds if seconds is not None else None
        watchdog = StatusWatchdog(client)
        while recorder.active and (until_s is None or time.monotonic() < until_s):
            watchdog.check()
            time.sleep(CHECK_PERIOD_S)
    except KeyboardInterrupt:
        pass
    finally:
        recorder.close()
    return recorder


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

    try:
        return replay(recording, config, on_message=publish, speed=speed)
    finally:
        server.close()


def _query_metadata(client: BusClient) -> RunMetadata:
    """Return the metadata of the run, which the robot publishes on the topic `session`."""
    received: list[str] = []
    has_received = threading.Event()

    def receive(message: Message) -> None:
        received.append(message.data)
        has_received.set()

    client.subscribe("session", receive)
    if not has_received.wait(SESSION_TIMEOUT_S):
        raise ThumperError(
            "the robot does not publish its run metadata; is it running, under this name?",
            exit_code=EXIT_NOT_THERE,
        )
    try:
        run = run_metadata_of(json.loads(received[-1]), "the running robot")
    except ValueError as error:
        raise ThumperError(f"cannot read the robot's run metadata: {error}") from error
    return replace(run, from_start=False)


def _add_message(recorder: Recorder, name: str, type_name: str) -> Callable[[Message], None]:
    """Return a sink for a latched topic. Ignore its stamp, which may be hours older than the recording."""
    return lambda message: recorder.add_cdr(name, type_name, None, encode(message))


def _add_raw(recorder: Recorder, name: str, type_name: str) -> Callable[[bytes], None]:
    return lambda cdr: recorder.add_cdr(name, type_name, _stamp_ns(type_name, cdr), cdr)


def _stamp_ns(type_name: str, cdr: bytes) -> int | None:
    """Return the stamp at the start of the message; None if its type has none there."""
    if type_name in ("tf2_msgs/msg/TFMessage", "std_msgs/msg/String"):
        return None
    stamp = cdr[STAMP]
    return int.from_bytes(stamp[:4], "little", signed=True) * NS_PER_S + int.from_bytes(stamp[4:], "little")
