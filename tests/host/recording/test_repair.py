"""A crash costs less than a second of recording, and nothing that was on the disk is lost in the repair."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import IO

import mcap.reader
import pytest
from mcap.writer import CompressionType, Writer

from tests.host.recording.samples import EPOCH_NS, SESSION, beats
from thumper.common.errors import ThumperError
from thumper.common.stamps import stamp_ns
from thumper.recording import repair as module
from thumper.recording.mcap_file import McapFile
from thumper.recording.repair import _copy, is_whole, left_behind, recover, recover_all, recover_apart
from thumper.recording.run_metadata import METADATA_NAME
from thumper.ros.codec import encode

CRASH = """
import sys, time
from pathlib import Path
from tests.host.recording.samples import SESSION, beats
from thumper.recording.recorder import Recorder

recorder = Recorder(Path(sys.argv[1]), SESSION)
start_s = time.monotonic()
for topic, now_s, message in beats(10_000):
    while time.monotonic() - start_s < now_s - 5.0:
        time.sleep(0.001)
    recorder(topic, now_s, message)
    if topic == "status":
        print(now_s, flush=True)
"""


def log_times(path: Path) -> list[int]:
    with path.open("rb") as stream:
        return [message.log_time for _, _, message in mcap.reader.make_reader(stream).iter_messages()]


def test_kill_9_costs_less_than_a_second(tmp_path: Path) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", CRASH, str(tmp_path)], stdout=subprocess.PIPE, text=True
    ) as run:
        assert run.stdout is not None
        said_s = 0.0
        while said_s < 5.0 + 3.2:
            said_s = float(run.stdout.readline())
        (part,) = tmp_path.glob("*.part")
        with pytest.raises(ThumperError, match="being recorded"):
            recover(part)
        assert left_behind(tmp_path) == []
        os.kill(run.pid, signal.SIGKILL)
        for line in run.stdout:
            said_s = float(line)
    assert left_behind(tmp_path) == [part]
    repair = recover(part)
    assert repair is not None
    assert is_whole(repair.path)
    lost_s = said_s - 1e-9 * (log_times(repair.path)[-1] - EPOCH_NS)
    assert lost_s <= 1.0
    assert repair.messages > 150
    assert list(tmp_path.iterdir()) == [repair.path]  # the original went once the new one was complete


@pytest.fixture(scope="module")
def torn(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, list[tuple[int, int]]]:
    """A file never closed, and after each flush its size and the messages in it."""
    path = tmp_path_factory.mktemp("torn") / "run.mcap"
    file = McapFile(path, {METADATA_NAME: SESSION.as_metadata()})
    sizes = [(file.bytes_written, 0)]
    for count, (topic, now_s, message) in enumerate(beats(20), start=1):
        file.add(topic, message.__msgtype__, stamp_ns(now_s, EPOCH_NS), encode(message))
        if count % 20 == 0:
            file.flush()
            sizes.append((file.bytes_written, count))
    file.abandon()
    return path.with_name("run.mcap.part").read_bytes(), sizes


def recovered(folder: Path, content: bytes) -> tuple[int, str]:
    part = folder / "torn.mcap.part"
    part.write_bytes(content)
    repair = recover(part)
    assert repair is not None
    assert is_whole(repair.path)
    assert len(log_times(repair.path)) == repair.messages
    assert not part.exists()
    repair.path.unlink()
    return repair.messages, repair.note


@pytest.mark.parametrize("seed", range(20))
def test_cut_anywhere_all_that_was_flushed_before_comes_back(
    tmp_path: Path, torn: tuple[bytes, list[tuple[int, int]]], seed: int
) -> None:
    content, sizes = torn
    cut = random.Random(seed).randrange(sizes[0][0], len(content))
    messages, _ = recovered(tmp_path, content[:cut])
    flushed = max(count for size, count in sizes if size <= cut)
    assert messages in (flushed, flushed + 20)  # the next chunk may be whole, and only its index cut


@pytest.mark.parametrize(
    "tail",
    [b"\x06" + (2**63).to_bytes(8, "little") + b"x" * 50, b"\x06" + b"\xff" * 60, b"\0" * 4096, b"\x05"],
    ids=["a chunk of 2^63 bytes", "a chunk of 2^64 bytes", "zeros", "one byte"],
)
def test_what_a_torn_record_promises_is_not_believed(
    tmp_path: Path, torn: tuple[bytes, list[tuple[int, int]]], tail: bytes
) -> None:
    content, sizes = torn
    messages, _ = recovered(tmp_path, content + tail)
    assert messages == sizes[-1][1]


def test_a_damaged_chunk_costs_only_itself(tmp_path: Path, torn: tuple[bytes, list[tuple[int, int]]]) -> None:
    content, sizes = torn
    middle = (sizes[3][0] + sizes[4][0]) // 2
    spoiled = (
        content[: middle - 200]
        + bytes(byte ^ 0x55 for byte in content[middle - 200 : middle])
        + content[middle:]
    )
    messages, note = recovered(tmp_path, spoiled)
    assert messages == sizes[-1][1] - 20
    assert "damaged" in note


def test_metadata_and_foreign_files_survive(tmp_path: Path) -> None:
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.LZ4)
        writer.start(profile="x", library="somebody")
        schema = writer.register_schema("s", "jsonschema", b"{}")
        channel = writer.register_channel("/a", "json", schema, {"k": "v"})
        writer.add_metadata("mine", {"a": "b"})
        writer.add_attachment(1, 2, "notes", "text/plain", b"hello")
        for n in range(9):
            writer.add_message(channel, 10 * n, b'{"n":1}', 10 * n + 1, n)
        writer.flush()
    before = path.read_bytes()
    repair = recover(path)
    assert repair is not None
    assert repair.path == path
    assert (tmp_path / "foreign.mcap.damaged").read_bytes() == before
    with path.open("rb") as stream:
        reader = mcap.reader.make_reader(stream)
        assert reader.get_header().profile == "x"
        assert [(m.name, m.metadata) for m in reader.iter_metadata()] == [("mine", {"a": "b"})]
        assert [a.data for a in reader.iter_attachments()] == [b"hello"]
        rows = [
            (c.topic, c.metadata, m.log_time, m.publish_time, m.sequence)
            for _, c, m in reader.iter_messages()
        ]
    assert rows == [("/a", {"k": "v"}, 10 * n, 10 * n + 1, n) for n in range(9)]
    assert recover(path) is None  # it is whole now


def test_a_name_that_is_taken_is_not_overwritten(
    tmp_path: Path, torn: tuple[bytes, list[tuple[int, int]]]
) -> None:
    (tmp_path / "torn.mcap").write_bytes(b"precious")
    recovered(tmp_path, torn[0])
    assert (tmp_path / "torn.mcap").read_bytes() == b"precious"


@pytest.mark.parametrize("content", [b"", b"hello", b"\x89MCAP0\r\n"])
def test_no_mcap_at_all_is_told_and_kept(tmp_path: Path, content: bytes) -> None:
    part = tmp_path / "x.mcap.part"
    part.write_bytes(content)
    with pytest.raises(ThumperError, match="no MCAP"):
        recover(part)
    assert part.read_bytes() == content
    assert list(tmp_path.iterdir()) == [part]


def test_two_do_not_repair_the_same_file(
    tmp_path: Path, torn: tuple[bytes, list[tuple[int, int]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    part = tmp_path / "a.mcap.part"
    part.write_bytes(torn[0])
    copied: list[str] = []

    def copy_while_another_tries(source: IO[bytes], sink: IO[bytes], profile: str) -> tuple[int, str]:
        copied.append(profile)
        with pytest.raises(ThumperError, match="repaired just now"):
            recover(part)
        assert left_behind(tmp_path) == []
        return _copy(source, sink, profile)

    monkeypatch.setattr(module, "_copy", copy_while_another_tries)
    assert recover(part) is not None
    assert copied == ["ros2"]
    assert is_whole(tmp_path / "a.mcap")


def test_a_start_has_it_done_by_another_process(
    tmp_path: Path, torn: tuple[bytes, list[tuple[int, int]]]
) -> None:
    (tmp_path / "a.mcap.part").write_bytes(torn[0])
    recover_apart(tmp_path)
    deadline_s = time.monotonic() + 30.0
    while (tmp_path / "a.mcap.part").exists() and time.monotonic() < deadline_s:
        time.sleep(0.05)
    assert is_whole(tmp_path / "a.mcap")


def test_all_that_crashes_left_is_repaired(tmp_path: Path, torn: tuple[bytes, list[tuple[int, int]]]) -> None:
    content, sizes = torn
    (tmp_path / "a.mcap.part").write_bytes(content)
    (tmp_path / "b.mcap.part").write_bytes(b"")
    (tmp_path / "c.mcap.part").write_bytes(b"something else")
    said: list[str] = []
    assert not recover_all(left_behind(tmp_path), said.append)
    assert f"a.mcap: repaired, {sizes[-1][1]} messages" in said[0]
    assert "c.mcap.part: no MCAP file" in said[1]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mcap", "c.mcap.part"]
