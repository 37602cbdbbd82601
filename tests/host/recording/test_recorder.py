"""Other programs can read recordings, and a recording that fails does not affect the robot."""

import re
import subprocess
import sys
import threading
import time
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import mcap.reader
import pytest
from benchmarks.shared.live import until
from benchmarks.shared.recorded_run import EPOCH_NS, RUN, cycles
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from tests.variants import some_of
from thumper.cli.output.recording_summary import recording_failure, recording_summary
from thumper.config.bus import BusOptions
from thumper.config.dashboard import DashboardOptions
from thumper.config.recording import RecordingOptions
from thumper.config.robot import RobotConfig
from thumper.recording.disk_budget import make_room, own_recordings
from thumper.recording.reader import Recording
from thumper.recording.recorder import Recorder
from thumper.recording.repair import is_complete, repair_all
from thumper.recording.run_metadata import RunMetadata, run_metadata_of
from thumper.ros.codec import encode
from thumper.ros.to_ros import text
from thumper.ros.topics import TOPICS


def record(folder: Path, count: int = 30, options: RecordingOptions | None = None) -> Recorder:
    recorder = Recorder(folder, RUN, options)
    for topic, now_s, message in cycles(count):
        recorder(topic, now_s, message)
    recorder.close()
    return recorder


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    recorder = record(tmp_path_factory.mktemp("recording"))
    assert not recorder.failure
    assert recorder.dropped == 0
    return recorder.files[0]


EXPECTED = Counter(f"/{topic}" for topic, _, _ in cycles(30))


def test_file_has_final_name_and_index(recording: Path) -> None:
    assert recording.name.startswith("mole_20")
    assert is_complete(recording)
    assert not list(recording.parent.glob("*.part"))


def test_mcap_reads_messages_in_recorded_order(recording: Path) -> None:
    with recording.open("rb") as stream:
        reader = mcap.reader.make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        messages = [(channel.topic, message) for _, channel, message in reader.iter_messages()]
    assert [topic for topic, _ in messages] == [f"/{topic}" for topic, _, _ in cycles(30)]
    times = [message.log_time for _, message in messages]
    assert times == sorted(times)
    assert times[0] == EPOCH_NS + 5_000_000_000


def test_messages_without_a_time_take_that_of_their_neighbours(tmp_path: Path) -> None:
    """Latched messages come first and may be old: the recording must not start in 1970 or hours ago."""
    recorder = Recorder(tmp_path, RUN)
    wheels = next(message for topic, _, message in cycles(1) if topic == "wheels")
    recorder.add_cdr("session", "std_msgs/msg/String", None, encode(text("{}")))
    recorder.add_cdr("wheels", wheels.__msgtype__, EPOCH_NS + 7, encode(wheels))
    recorder.add_cdr("session", "std_msgs/msg/String", None, encode(text("{}")))
    recorder.close()
    with recorder.files[0].open("rb") as stream:
        messages = [
            (channel.topic, message.log_time)
            for _, channel, message in mcap.reader.make_reader(stream).iter_messages()
        ]
    assert messages == [(topic, EPOCH_NS + 7) for topic in ("/session", "/wheels", "/session")]


def test_times_never_decrease_in_the_file(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, RUN)
    for time_ns in (7, 3, 9):
        recorder.add_cdr("command", "std_msgs/msg/String", EPOCH_NS + time_ns, encode(text("arm")))
    recorder.close()
    with recorder.files[0].open("rb") as stream:
        in_file_order = mcap.reader.make_reader(stream).iter_messages(log_time_order=False)
        assert [message.log_time - EPOCH_NS for _, _, message in in_file_order] == [7, 7, 9]


def test_mcap_ros2_decodes_every_message(recording: Path) -> None:
    seen: Counter[str] = Counter()
    with recording.open("rb") as stream:
        reader = mcap.reader.make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, _, ros in reader.iter_decoded_messages():
            seen[channel.topic] += 1
            if channel.topic == "/wheels":
                assert ros.right_integral == 4
            elif channel.topic == "/scan":
                assert len(ros.ranges) == 682
            elif channel.topic == "/map":
                assert (ros.info.width, ros.info.height) == (30, 40)
    assert seen == EXPECTED


def test_rosbags_reads_it_with_the_embedded_definitions(recording: Path) -> None:
    with AnyReader([recording], default_typestore=get_typestore(Stores.EMPTY)) as reader:
        assert {c.topic: c.msgcount for c in reader.connections} == EXPECTED
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            if connection.topic == "/status":
                assert message.mode == "navigating"  # type: ignore[attr-defined]


def test_metadata_has_configuration_and_version(recording: Path) -> None:
    with recording.open("rb") as stream:
        (record_of,) = list(mcap.reader.make_reader(stream).iter_metadata())
    assert run_metadata_of(record_of.metadata, "it") == RUN
    assert {"version", "firmware", "packages", "python"} <= record_of.metadata.keys()


def test_secrets_are_not_recorded() -> None:
    bus, page = BusOptions(token="correct horse battery"), DashboardOptions(password="open sesame 1234")
    text = str(RunMetadata(config=RobotConfig(bus=bus, dashboard=page), epoch_ns=0).as_metadata())
    assert "correct horse" not in text
    assert "sesame" not in text


def test_rotation_keeps_the_budget_and_other_files(tmp_path: Path) -> None:
    strangers = [tmp_path / "mole_20200101-000000_000.mcap", tmp_path / "mine.mcap", tmp_path / "notes.txt"]
    for path in strangers:
        path.write_bytes(b"precious" * 100_000)
    options = RecordingOptions(file_MB=0.05, budget_MB=0.3)
    recorder = Recorder(tmp_path, RUN, options, flush_period_s=0.01)
    for topic, now_s, message in cycles(600):
        recorder(topic, now_s, message)
        if topic == "status":
            time.sleep(0.002)
    recorder.close()
    assert not recorder.failure
    left = sorted(set(tmp_path.glob("*.mcap")) - set(strangers))
    assert len(recorder.files) > 8
    assert left == recorder.files[-len(left) :]  # the oldest were deleted
    assert 2 <= len(left) < len(recorder.files)
    assert sum(path.stat().st_size for path in left) <= 0.3e6 * 1.1
    assert all(path.exists() for path in strangers)
    with left[-1].open("rb") as stream:  # the latched map of an earlier file is repeated here
        topics = {channel.topic for _, channel, _ in mcap.reader.make_reader(stream).iter_messages()}
    assert {
        f"/{name}" for name, topic in TOPICS.items() if topic.latched and name in ("map", "status")
    } <= topics


def test_hanging_disk_only_drops_messages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hang = threading.Event()
    monkeypatch.setattr("thumper.recording.mcap_file.os.fsync", lambda _: hang.wait(20.0))
    hang.set()
    recorder = Recorder(tmp_path, RUN, flush_period_s=0.01, queue_size=16)
    hang.clear()
    time.sleep(0.1)
    offered = 0
    for topic, now_s, message in cycles(30):
        recorder(topic, now_s, message)
        offered += 1
    assert recorder.dropped == offered - 16
    hang.set()
    recorder.close()
    assert recorder.written == 16
    assert is_complete(recorder.files[0])


FULL_DISK = """
import resource, sys, time
from pathlib import Path
from benchmarks.shared.recorded_run import RUN, cycles
from thumper.recording import recorder as module
from thumper.recording.recorder import Recorder

def record(first, last):
    sent = 0
    for k, (topic, now_s, message) in enumerate(cycles(last)):
        if now_s >= 5.0 + 0.1 * first:
            recorder(topic, now_s, message)
            sent += 1
            time.sleep(0.0005)
    return sent

module.ROOM_PERIOD_S = 0.5
reports = []
recorder = Recorder(Path(sys.argv[1]), RUN, report=reports.append, flush_period_s=0.02)
sent = record(0, 20)
while recorder.written < sent:
    time.sleep(0.01)
time.sleep(0.5)  # flushed as well
resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, resource.RLIM_INFINITY))  # no file grows beyond 60 kB
until_s = time.monotonic() + 60.0
for k in range(20, 10000):
    if reports or time.monotonic() > until_s:
        break
    record(k, k + 1)
resource.setrlimit(resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))
time.sleep(1.5)  # it tries again, in vain
assert recorder.is_paused and recorder.active, reports
if sys.argv[2] == "room":
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    while recorder.is_paused and time.monotonic() < until_s:
        record(100, 200)
    record(200, 300)
recorder.close()
print(*reports, sep="\\n")
print("failure:", recorder.failure)
print("file:", recorder.files[-1])
"""


@pytest.mark.parametrize("there_is_room", some_of([True, False]))
def test_full_disk_pauses_the_recording_and_keeps_what_is_written(
    tmp_path: Path, *, there_is_room: bool
) -> None:
    command = [sys.executable, "-c", FULL_DISK, str(tmp_path), "room" if there_is_room else "none"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0] == "recording paused: File too large; it continues when there is room"
    part = next(tmp_path.glob("*_000.mcap.part"))
    assert repair_all([part], print) == []
    first = sum(message.topic == "wheels" for message in Recording((tmp_path / part.stem,)).messages())
    assert first >= 20  # everything from before the disk was full
    if there_is_room:
        assert re.fullmatch(r"recording continues; [1-9]\d* messages are missing", lines[-3])
        assert lines[-2] == "failure: "
        topics = Counter(m.topic for m in Recording((Path(lines[-1].removeprefix("file: ")),)).messages())
        assert topics["wheels"] > 50
        assert topics["plan"]  # the newest of latched topics stands in each file
    else:
        assert lines[1:-1] == ["failure: the disk is full"]
        assert list(tmp_path.iterdir()) == [tmp_path / part.stem]  # no file for each attempt


def test_low_disk_space_pauses_and_finishes_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    free_bytes = [1e12]
    usage = SimpleNamespace(disk_usage=lambda _: SimpleNamespace(free=free_bytes[0]))
    monkeypatch.setattr("thumper.recording.disk_budget.shutil", usage)
    monkeypatch.setattr("thumper.recording.recorder.ROOM_PERIOD_S", 0.01)
    reports: list[str] = []
    recorder = Recorder(tmp_path, RUN, report=reports.append, flush_period_s=0.01)
    for topic, now_s, message in cycles(10):
        recorder(topic, now_s, message)
    until(lambda: recorder.written > 50)
    free_bytes[0] = 1e8
    until(lambda: reports)
    assert reports == [
        "recording paused: less than 256 MB are free on the disk; delete files; it continues when "
        "there is room"
    ]
    (whole,) = tmp_path.glob("*.mcap")
    assert is_complete(whole)
    free_bytes[0] = 1e12
    until(lambda: not recorder.is_paused)
    for topic, now_s, message in cycles(20):
        recorder(topic, now_s, message)
    recorder.close()
    assert not recorder.failure
    assert len(list(tmp_path.glob("*.mcap"))) == 2


def test_budget_counts_parts_beyond_999(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, RUN)
    recorder.close()
    names = [f"mole_20260101-000000_{part:03d}.mcap" for part in (998, 999, 1000, 1001, 10000)]
    names.append("mole_20260101-000000_1001-2.mcap")
    for name in names:
        (tmp_path / name).write_bytes(recorder.files[0].read_bytes())
    recorder.files[0].unlink()
    oldest_first = [names[0], names[1], names[2], names[3], names[5], names[4]]
    assert [path.name for path in own_recordings(tmp_path, "mole")] == oldest_first
    size = (tmp_path / names[0]).stat().st_size
    deleted = make_room(tmp_path, "mole", budget_bytes=2.5 * size, reserve_bytes=0)
    assert [path.name for path in deleted] == oldest_first[:4]


def test_a_recording_for_which_there_never_was_room_is_reported(tmp_path: Path) -> None:
    options = RecordingOptions(spare_MB=1e9)
    reports: list[str] = []
    recorder = Recorder(tmp_path, RUN, options, report=reports.append)
    until(lambda: reports)
    for topic, now_s, message in cycles(2):
        recorder(topic, now_s, message)
    recorder.close()
    assert re.fullmatch(
        r"0 messages, [1-9]\d* missing: the disk was full or too slow", recording_summary(recorder)
    )
    assert recording_failure(recorder) == "the recording ended early: the disk is full"


def test_the_summary_names_the_file_and_a_failure_its_repair(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, RUN)
    for topic, now_s, message in cycles(2):
        recorder(topic, now_s, message)
    recorder.close()
    assert recording_summary(recorder) == f"{recorder.written} messages: {recorder.files[-1]}"
    assert not recording_failure(recorder)
    recorder.failure = "the disk is full"
    assert recording_failure(recorder).endswith(f"; `thumper recover {tmp_path}` repairs its last file")
