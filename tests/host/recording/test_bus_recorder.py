"""A recording said again on a bus: whoever listens cannot tell it from a robot."""

import threading
from pathlib import Path
from typing import Any

import pytest

from tests.host.recording.samples import SESSION, beats
from tests.live import free_port, until
from thumper.bus.client import BusClient
from thumper.common.errors import ThumperError
from thumper.recording.bus_recorder import replay_on_bus
from thumper.recording.reader import Recording
from thumper.recording.recorder import Recorder
from thumper.recording.replay import Replayed


def test_a_replay_is_heard_on_the_bus(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, SESSION)
    for topic, now_s, message in beats(60):
        recorder(topic, now_s, message)
    recorder.close()
    with pytest.raises(ThumperError, match="no address"):
        replay_on_bus(Recording((recorder.files[0],)), None, "127.0.0.1:99999", speed=2.0)
    address, done = f"127.0.0.1:{free_port()}", []

    def run() -> None:
        done.append(replay_on_bus(Recording((recorder.files[0],)), None, address, speed=2.0))

    thread = threading.Thread(target=run)
    thread.start()
    client = joined(address)
    heard: list[Any] = []
    client.subscribe("wheels", heard.append)
    maps: list[Any] = []
    client.subscribe("map", maps.append)
    thread.join(30.0)
    client.close()
    out: Replayed = done[0]
    assert out.scans > 40
    assert len(heard) > 10
    counts = [message.left_count for message in heard]
    assert counts == sorted(counts)
    assert (maps[-1].info.width, maps[-1].info.height) == (30, 40)


def joined(address: str) -> BusClient:
    def join() -> BusClient | None:
        try:
            return BusClient(SESSION.config.name, address)
        except ThumperError:
            return None

    client: BusClient = until(join)
    return client
