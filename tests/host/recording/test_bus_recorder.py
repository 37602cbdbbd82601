"""A replayed recording looks like a robot on the bus."""

import threading
from pathlib import Path
from typing import Any

import pytest
from benchmarks.shared.live import free_port, until
from benchmarks.shared.recorded_run import RUN, cycles

from thumper.bus.client import BusClient
from thumper.common.errors import ThumperError
from thumper.recording.bus_recorder import replay_on_bus
from thumper.recording.reader import Recording
from thumper.recording.recorder import Recorder
from thumper.recording.replay import ReplayResult


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


def connect(address: str) -> BusClient:
    def try_connect() -> BusClient | None:
        try:
            return BusClient(RUN.config.name, address)
        except ThumperError:
            return None

    client: BusClient = until(try_connect)
    return client
