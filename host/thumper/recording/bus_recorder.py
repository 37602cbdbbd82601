"""Recording a robot that runs elsewhere, and saying a recording again, both over the bus."""

import json
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from thumper.bus.client import BusClient
from thumper.bus.heartbeat_sender import HeartbeatSender
from thumper.bus.server import BusServer
from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.common.stamps import NS_PER_S
from thumper.config.bus import BusOptions
from thumper.config.recording import RecordingOptions
from thumper.config.robot import RobotConfig
from thumper.recording.reader import RecordedMessage, Recording
from thumper.recording.recorder import Recorder
from thumper.recording.replay import Replayed, replay
from thumper.recording.run_metadata import RunMetadata, session_of
from thumper.ros.codec import Message, encode
from thumper.ros.topics import TOPICS, Direction
from thumper.runtime.service.request_queue import RequestQueue

SESSION_TIMEOUT_S = 3.0
LOOK_PERIOD_S = 0.2
STAMP = slice(4, 12)  # of CDR: after its own header, where a message begins with its stamp


def record_from_bus(
    client: BusClient,
    folder: Path,
    options: RecordingOptions,
    *,
    seconds: float | None,
    say: Callable[[str], None],
) -> Recorder:
    """Record all that the robot says until Ctrl-C, for `seconds`, or until trouble; returns the recorder.

    Raises
    ------
    ThumperError
        The robot does not say which run this is: nobody is there, or another version; or it falls silent.
    """
    recorder = Recorder(folder, _ask_session(client), options, say=say)
    try:
        for name, topic in TOPICS.items():
            if topic.direction is Direction.IN:
                continue
            if topic.latched:  # only so is the newest of it given
                client.subscribe(name, _add_message(recorder, name, topic.type_name))
            else:
                client.subscribe_raw(name, _add_raw(recorder, name, topic.type_name))
        until_s = time.monotonic() + seconds if seconds is not None else None
        pulse = HeartbeatSender(client)
        while recorder.active and (until_s is None or time.monotonic() < until_s):
            pulse.check()
            time.sleep(LOOK_PERIOD_S)
    except KeyboardInterrupt:
        pass
    finally:
        recorder.close()
    return recorder


def replay_on_bus(recording: Recording, config: RobotConfig | None, address: str, speed: float) -> Replayed:
    """Replay at `speed` times the clock, and say every message on a bus at `address`.

    Raises
    ------
    ThumperError
        As `replay`; or the address is taken, or none.
    """
    session = recording.session()
    name = session.config.name if session else "replay"
    server = BusServer(name, BusOptions().at(address), RequestQueue(), lambda _: None)

    def say(said: RecordedMessage, message: Message) -> None:
        if TOPICS[said.topic].direction is Direction.OUT:
            server.publish(said.topic, 0.0, message)

    try:
        return replay(recording, config, on_said=say, speed=speed)
    finally:
        server.close()


def _ask_session(client: BusClient) -> RunMetadata:
    """What the robot says of its run on the topic `session`."""
    heard: list[str] = []
    came = threading.Event()

    def take(message: Message) -> None:
        heard.append(message.data)
        came.set()

    client.subscribe("session", take)
    if not came.wait(SESSION_TIMEOUT_S):
        raise ThumperError(
            "the robot does not say which run this is: does it run, under this name?",
            exit_code=EXIT_NOT_THERE,
        )
    try:
        session = session_of(json.loads(heard[-1]), "the running robot")
    except ValueError as error:
        raise ThumperError(f"the robot's session cannot be read: {error}") from error
    return replace(session, from_start=False)


def _add_message(recorder: Recorder, name: str, type_name: str) -> Callable[[Message], None]:
    def add(message: Message) -> None:
        cdr = encode(message)
        recorder.add_cdr(name, type_name, _stamp_ns(type_name, cdr), cdr)

    return add


def _add_raw(recorder: Recorder, name: str, type_name: str) -> Callable[[bytes], None]:
    return lambda cdr: recorder.add_cdr(name, type_name, _stamp_ns(type_name, cdr), cdr)


def _stamp_ns(type_name: str, cdr: bytes) -> int:
    """The stamp that the message begins with; 0, which means as the one before, where it does not."""
    if type_name in ("tf2_msgs/msg/TFMessage", "std_msgs/msg/String"):
        return 0
    stamp = cdr[STAMP]
    return int.from_bytes(stamp[:4], "little", signed=True) * NS_PER_S + int.from_bytes(stamp[4:], "little")
