"""Recording over the bus, and a replayed recording that looks like a robot."""

import json
import threading
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from benchmarks.shared.live import free_port, until
from benchmarks.shared.recorded_run import RUN, cycle, cycles

from thumper.bus.client import BusClient
from thumper.bus.server import BusServer
from thumper.common.errors import ThumperError
from thumper.common.stamps import stamp_ns
from thumper.config.bus import BusOptions
from thumper.config.recording import RecordingOptions
from thumper.recording.bus_recorder import BusRecording, _stamp_ns, replay_on_bus
from thumper.recording.reader import Recording
from thumper.recording.recorder import Recorder
from thumper.recording.replay import ReplayResult
from thumper.recording.run_metadata import RunMetadata
from thumper.ros.codec import encode
from thumper.ros.to_ros import text
from thumper.runtime.service.request_queue import RequestQueue


def test_replay_publishes_on_the_bus(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, RUN)
    for topic, now_s, message in cycles(60):
        recorder(topic, now_s, message)
    recorder.close()
    with pytest.raises(ThumperError, match="is not an address"):
        replay_on_bus(Recording((recorder.files[0],)), None, "127.0.0.1:99999", speed=2.0)
    address, done = f"127.0.0.1:{free_port()}", []

    def run() -> None:
        done.append(replay_on_bus(Recording((recorder.files[0],)), None, address, speed=2.0))

    thread = threading.Thread(target=run)
    thread.start()
    client = connect(address)
    received: list[Any] = []
    client.subscribe("wheels", received.append)
    maps: list[Any] = []
    client.subscribe("map", maps.append)
    thread.join(30.0)
    client.close()
    out: ReplayResult = done[0]
    assert out.scans > 40
    assert len(received) > 10
    counts = [message.left_count for message in received]
    assert counts == sorted(counts)
    assert (maps[-1].info.width, maps[-1].info.height) == (30, 40)


def test_restarted_robot_starts_a_new_recording(tmp_path: Path) -> None:
    address = f"127.0.0.1:{free_port()}"
    lines: list[str] = []
    server = start_robot(address, RUN)
    client = connect(address)
    recording = BusRecording(client, tmp_path, RecordingOptions(spare_MB=0), lines.append)

    def has_recorders(count: int) -> bool:
        return len(recording.recorders) == count

    for run in (0, 1):
        until(partial(has_recorders, run + 1))
        for k in range(20):
            for topic, now_s, message in cycle(k + 100 * run):
                server.publish(topic, now_s, message)
            time.sleep(0.05)
        until(lambda: recording.recorders[-1].written > 120)
        if not run:
            server.close()
            server = start_robot(address, replace(RUN, epoch_ns=RUN.epoch_ns + 1))
    recording.close()
    client.close()
    server.close()
    recorders = recording.recorders
    assert len(recorders) == 2
    assert lines == ["the robot has restarted: a new recording starts"]
    for recorder, epoch_ns in zip(recorders, (RUN.epoch_ns, RUN.epoch_ns + 1), strict=True):
        recorded = Recording(tuple(recorder.files))
        run_metadata = recorded.run_metadata()
        assert run_metadata is not None
        assert run_metadata.epoch_ns == epoch_ns
        assert len([message for message in recorded.messages() if message.topic == "wheels"]) >= 15


def test_stamp_is_read_from_each_kind_of_message() -> None:
    for topic, now_s, message in cycle(0):
        expected = stamp_ns(now_s - 0.1 if topic == "scan" else now_s, RUN.epoch_ns)
        assert _stamp_ns(message.__msgtype__, encode(message)) == expected, topic
    assert _stamp_ns("std_msgs/msg/String", encode(text("a long enough text"))) is None
    assert _stamp_ns("tf2_msgs/msg/TFMessage", b"\0\1\0\0\0\0\0\0") is None  # no transforms


def start_robot(address: str, run: RunMetadata) -> BusServer:
    server = BusServer(RUN.config.name, BusOptions(address=address), RequestQueue(), print)
    server.publish("session", 0.0, text(json.dumps(run.as_metadata())))
    return server


def connect(address: str) -> BusClient:
    def try_connect() -> BusClient | None:
        try:
            return BusClient(RUN.config.name, address)
        except ThumperError:
            return None

    client: BusClient = until(try_connect)
    return client
