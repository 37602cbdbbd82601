"""A crash loses less than one second of a recording, and the repair loses nothing that is on the disk."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import mcap.reader
import pytest
from benchmarks.shared.live import END_WITH_PARENT
from benchmarks.shared.recorded_run import EPOCH_NS, RUN, cycles
from mcap.writer import CompressionType, Writer

from thumper.common.errors import ThumperError
from thumper.common.stamps import stamp_ns
from thumper.recording.mcap_file import McapFile
from thumper.recording.repair import (
    is_complete,
    repair,
    repair_all,
    repair_in_subprocess,
    unfinished_recordings,
)
from thumper.recording.run_metadata import METADATA_NAME
from thumper.ros.codec import encode

CRASH = """
import sys, time
from pathlib import Path
from benchmarks.shared.recorded_run import RUN, cycles
from thumper.recording.recorder import Recorder

recorder = Recorder(Path(sys.argv[1]), RUN)
start_s = time.monotonic()
for topic, now_s, message in cycles(10_000):
    while time.monotonic() - start_s < now_s - 5.0:
        time.sleep(0.001)
    recorder(topic, now_s, message)
    if topic == "status":
        print(now_s, flush=True)
"""


def log_times(path: Path) -> list[int]:
    with path.open("rb") as stream:
        return [message.log_time for _, _, message in mcap.reader.make_reader(stream).iter_messages()]


def test_kill_9_loses_less_than_a_second(tmp_path: Path) -> None:
    with subprocess.Popen(
        [*END_WITH_PARENT, sys.executable, "-c", CRASH, str(tmp_path)], stdout=subprocess.PIPE, text=True
    ) as run:
        assert run.stdout is not None
        published_s = 0.0
        while published_s < 5.0 + 3.2:
            published_s = float(run.stdout.readline())
        (part,) = tmp_path.glob("*.part")
        with pytest.raises(ThumperError, match="recording or repairing it"):
            repair(part)
        assert unfinished_recordings(tmp_path) == []
        os.kill(run.pid, signal.SIGKILL)
        for line in run.stdout:
            published_s = float(line)
    assert unfinished_recordings(tmp_path) == [part]
    result = repair(part)
    assert result is not None
    assert is_complete(result.path)
    lost_s = published_s - 1e-9 * (log_times(result.path)[-1] - EPOCH_NS)
    assert lost_s <= 1.0
    assert result.messages > 150
    assert list(tmp_path.iterdir()) == [
        result.path
    ]  # the original was deleted once the new file was complete


@pytest.fixture(scope="module")
def truncated(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, list[tuple[int, int]]]:
    """An unfinished file; after each flush its size and number of messages."""
    path = tmp_path_factory.mktemp("truncated") / "run.mcap"
    file = McapFile(path, {METADATA_NAME: RUN.as_metadata()})
    sizes = [(file.bytes_written, 0)]
    for count, (topic, now_s, message) in enumerate(cycles(20), start=1):
        file.add(topic, message.__msgtype__, stamp_ns(now_s, EPOCH_NS), encode(message))
        if count % 20 == 0:
            file.flush()
            sizes.append((file.bytes_written, count))
    file.abandon()
    return path.with_name("run.mcap.part").read_bytes(), sizes


def repair_and_check(folder: Path, content: bytes) -> tuple[int, str]:
    part = folder / "truncated.mcap.part"
    part.write_bytes(content)
    result = repair(part)
    assert result is not None
    assert is_complete(result.path)
    assert len(log_times(result.path)) == result.messages
    assert not part.exists()
    result.path.unlink()
    return result.messages, result.note


@pytest.mark.parametrize("seed", range(20))
def test_truncated_file_keeps_all_flushed_messages(
    tmp_path: Path, truncated: tuple[bytes, list[tuple[int, int]]], seed: int
) -> None:
    content, sizes = truncated
    cut = random.Random(seed).randrange(sizes[0][0], len(content))
    messages, _ = repair_and_check(tmp_path, content[:cut])
    flushed = max(count for size, count in sizes if size <= cut)
    assert messages in (flushed, flushed + 20)  # the next chunk may be complete, with only its index cut off


@pytest.mark.parametrize(
    "tail",
    [b"\x06" + (2**63).to_bytes(8, "little") + b"x" * 50, b"\x06" + b"\xff" * 60, b"\0" * 4096, b"\x05"],
    ids=["a chunk of 2^63 bytes", "a chunk of 2^64 bytes", "zeros", "one byte"],
)
def test_lengths_in_damaged_records_are_not_trusted(
    tmp_path: Path, truncated: tuple[bytes, list[tuple[int, int]]], tail: bytes
) -> None:
    content, sizes = truncated
    messages, _ = repair_and_check(tmp_path, content + tail)
    assert messages == sizes[-1][1]


def test_only_the_damaged_chunk_is_lost(
    tmp_path: Path, truncated: tuple[bytes, list[tuple[int, int]]]
) -> None:
    content, sizes = truncated
    middle = (sizes[3][0] + sizes[4][0]) // 2
    damaged = (
        content[: middle - 200]
        + bytes(byte ^ 0x55 for byte in content[middle - 200 : middle])
        + content[middle:]
    )
    messages, note = repair_and_check(tmp_path, damaged)
    assert messages == sizes[-1][1] - 20
    assert "damaged" in note


def test_foreign_file_keeps_metadata_and_attachments(tmp_path: Path) -> None:
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
    result = repair(path)
    assert result is not None
    assert result.path == path
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
    assert repair(path) is None  # complete now


def test_existing_file_is_not_overwritten(
    tmp_path: Path, truncated: tuple[bytes, list[tuple[int, int]]]
) -> None:
    (tmp_path / "truncated.mcap").write_bytes(b"precious")
    repair_and_check(tmp_path, truncated[0])
    assert (tmp_path / "truncated.mcap").read_bytes() == b"precious"


@pytest.mark.parametrize("content", [b"", b"hello", b"\x89MCAP0\r\n"])
def test_other_files_are_refused_and_kept(tmp_path: Path, content: bytes) -> None:
    part = tmp_path / "x.mcap.part"
    part.write_bytes(content)
    with pytest.raises(ThumperError, match="not an MCAP file"):
        repair(part)
    assert part.read_bytes() == content
    assert list(tmp_path.iterdir()) == [part]


def test_a_file_is_repaired_by_one_program_only(
    tmp_path: Path, truncated: tuple[bytes, list[tuple[int, int]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    part = tmp_path / "a.mcap.part"
    part.write_bytes(truncated[0])
    tried = 0

    def sync_while_another_tries(descriptor: int) -> None:
        nonlocal tried
        with pytest.raises(ThumperError, match="recording or repairing it"):
            repair(part)
        assert unfinished_recordings(tmp_path) == []
        tried += 1
        sync(descriptor)

    sync = os.fsync
    monkeypatch.setattr(os, "fsync", sync_while_another_tries)
    assert repair(part) is not None
    assert tried
    assert is_complete(tmp_path / "a.mcap")


def test_start_repairs_in_another_process(
    tmp_path: Path, truncated: tuple[bytes, list[tuple[int, int]]]
) -> None:
    (tmp_path / "a.mcap.part").write_bytes(truncated[0])
    repair_in_subprocess(tmp_path)
    deadline_s = time.monotonic() + 30.0
    while (tmp_path / "a.mcap.part").exists() and time.monotonic() < deadline_s:
        time.sleep(0.05)
    assert is_complete(tmp_path / "a.mcap")


def test_all_incomplete_files_are_repaired(
    tmp_path: Path, truncated: tuple[bytes, list[tuple[int, int]]]
) -> None:
    content, sizes = truncated
    (tmp_path / "a.mcap.part").write_bytes(content)
    (tmp_path / "b.mcap.part").write_bytes(b"")
    (tmp_path / "c.mcap.part").write_bytes(b"something else")
    reports: list[str] = []
    (failure,) = repair_all(unfinished_recordings(tmp_path), reports.append)
    assert "c.mcap.part: not an MCAP file" in str(failure)
    (report,) = reports
    assert f"a.mcap: repaired, {sizes[-1][1]} messages" in report
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mcap", "c.mcap.part"]
