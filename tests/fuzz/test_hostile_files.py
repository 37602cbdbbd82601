"""Pipes, devices, files that are or unpack to far too much: refused at once, in one line."""

import gzip
import json
import os
import resource
import struct
import threading
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import lz4.frame  # type: ignore[import-untyped]
import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Chunk, ChunkIndex, DataEnd, Footer, Header, Schema, Statistics

from tests.fuzz.mutate import with_valid_checksum
from tests.fuzz.readers import YAML, Reader, read_part, read_recording, readers, write_grid
from thumper.common.errors import ThumperError
from thumper.config.robot import load_config
from thumper.maps.map_server_io import load_map
from thumper.offline.open_log import MCAP_MAGIC, open_log
from thumper.recording.repair import repair
from thumper.slam.saved_state import load_session
from thumper_hil.campaign.spec import load_campaign
from thumper_hil.faults.scenario import load_scenario
from thumper_hil.world.world import World
from thumper_tuning.calibration.wheel_log import COUNT_COLUMNS, read_csv
from thumper_tuning.logs.read import read_logs

MEMORY_BYTES = 1_000_000_000
READ_S = 30.0  # on a busy machine; a reader that waits on a pipe never ends


@contextmanager
def memory_limited() -> Iterator[None]:
    """Let the process allocate no more than `MEMORY_BYTES`."""
    used_bytes = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used_bytes + MEMORY_BYTES, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def refused(read: Callable[[Path], object], path: Path) -> str:
    """Return the error; fail if the reader does anything else, waits, or needs much memory."""
    messages: list[str] = []

    def run() -> None:
        with memory_limited(), pytest.raises(ThumperError) as caught:
            read(path)
        messages.append(str(caught.value))

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(READ_S)
    assert not thread.is_alive(), "it waits"
    assert messages
    return messages[0]


@pytest.fixture(params=readers(), ids=lambda reader: str(reader.name))
def reader(request: pytest.FixtureRequest, tmp_path: Path) -> Reader:
    chosen: Reader = request.param
    chosen.beside(tmp_path)
    (tmp_path / chosen.file).unlink(missing_ok=True)
    return chosen


def test_a_pipe_is_refused(reader: Reader, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / reader.file)
    assert "not a regular file" in refused(reader.read, tmp_path / reader.file)


def test_an_endless_device_is_refused(reader: Reader, tmp_path: Path) -> None:
    (tmp_path / reader.file).symlink_to("/dev/zero")
    assert "not a regular file" in refused(reader.read, tmp_path / reader.file)


def test_a_file_of_50_GB_is_refused(reader: Reader, tmp_path: Path) -> None:
    """It is sparse and takes no space; read whole, it would fill the memory."""
    with (tmp_path / reader.file).open("wb") as stream:
        stream.truncate(50_000_000_000)
    refused(reader.read, tmp_path / reader.file)


@pytest.mark.parametrize("byte", [b"\0", b"a", b"["])
def test_a_file_of_one_long_line_is_refused_in_a_short_one(
    reader: Reader, tmp_path: Path, byte: bytes
) -> None:
    if reader.name == "rows":
        pytest.skip("its last line may be cut: the campaign continues there")
    (tmp_path / reader.file).write_bytes(100_000 * byte)
    message = refused(reader.read, tmp_path / reader.file)
    assert len(message) < len(str(tmp_path)) + 600
    assert message.isprintable()


@pytest.mark.parametrize("read", [read_logs, lambda path: read_csv(path, COUNT_COLUMNS)])
@pytest.mark.parametrize("line", [b"a" * 70_000, b"a," * 40_000])
def test_a_line_that_no_table_has_is_refused(
    tmp_path: Path, read: Callable[[Path], object], line: bytes
) -> None:
    """Guessing its separator and names would take minutes."""
    path = tmp_path / "a.csv"
    path.write_bytes(b"# a comment\n" + line + b"\n1\n")
    assert "line 2 is longer than 64 kB" in refused(read, path)


@pytest.mark.filterwarnings("error")
def test_an_empty_wheel_log_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "a.csv").touch()
    assert "it is empty" in refused(lambda path: read_csv(path, COUNT_COLUMNS), tmp_path / "a.csv")


@pytest.mark.parametrize("image", ["/dev/zero", "pipe", "..", "\0"])
def test_an_image_that_is_no_file_is_refused(tmp_path: Path, image: str) -> None:
    write_grid(tmp_path)
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "map.yaml").write_text(YAML.replace("map.pgm", image).replace("0.3]", "0.0]"))
    refused(load_map, tmp_path / "map.yaml")


@pytest.mark.parametrize("size", ["100000 100000", "9999999999 1", "-4 4"])
def test_an_image_of_false_size_is_refused(tmp_path: Path, size: str) -> None:
    write_grid(tmp_path)
    (tmp_path / "map.pgm").write_bytes(b"P5\n" + size.encode() + b"\n255\n" + bytes(100))
    refused(load_map, tmp_path / "map.yaml")


def zlib_zeros() -> bytes:
    """Return 4 GB of zeros in 4 MB."""
    packer = zlib.compressobj(9, wbits=-15)
    block = packer.compress(bytes(10_000_000)) + packer.flush(zlib.Z_FULL_FLUSH)
    return b"\x78\xda" + 400 * block


def test_a_matlab_file_that_unpacks_to_4_GB_is_refused(tmp_path: Path) -> None:
    path, payload = tmp_path / "bomb.mat", zlib_zeros()
    version = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    path.write_bytes(version + struct.pack("<II", 15, len(payload)) + payload)
    assert "unpacks to more than" in refused(read_logs, path)


def test_a_session_that_unpacks_to_4_GB_is_refused(tmp_path: Path) -> None:
    header = {
        "thumper_session": 2,
        "shape": [10, 10],
        "first_cell": [0, 0],
        "resolution_m": 0.05,
        "pose": None,
        "sha256": "",
    }
    path = tmp_path / "bomb.session"
    path.write_bytes(with_valid_checksum(json.dumps(header).encode() + b"\n" + zlib_zeros()))
    assert "not a mapping session" in refused(lambda path: load_session(path, 0.05), path)


@pytest.mark.parametrize("start", [b"", b"FLASER 2 1.0 1.0 ", b"\x89MCAP0\r\n"])
def test_a_log_that_unpacks_to_one_line_of_4_GB_is_refused(tmp_path: Path, start: bytes) -> None:
    path = tmp_path / "bomb.log.gz"
    path.write_bytes(gzip.compress(start) + 400 * gzip.compress(b"1" * 10_000_000))
    refused(open_log, path)


@cache
def zeros(count: int, compression: str, start: bytes) -> bytes:
    """Return the compressed form of so many zeros after the start."""
    if compression == "lz4":
        packed: bytes = lz4.frame.compress(start + bytes(count))
        return packed
    packer = zstandard.ZstdCompressor().compressobj(size=len(start) + count)
    parts = [start, *((count // 1_000_000) * [bytes(1_000_000)])]
    return b"".join((*map(packer.compress, parts), packer.flush()))


def write_mcap(path: Path, chunks: int, unpacked: int, compression: str, *, records: bool = False) -> None:
    """Write a file of such chunks, each with one record or with millions, and an index.

    Each chunk says that it unpacks to a few bytes.
    """
    record = b"" if records else b"\x80" + unpacked.to_bytes(8, "little")
    data, indexes = zeros(unpacked, compression, record), list[ChunkIndex]()
    builder = RecordBuilder()
    builder.write(MCAP_MAGIC)
    Header(profile="ros2", library="bomb").write(builder)
    for _ in range(chunks):
        start = builder.count
        Chunk(
            compression=compression,
            data=data,
            message_start_time=0,
            message_end_time=10,
            uncompressed_crc=0,
            uncompressed_size=100,
        ).write(builder)
        indexes.append(
            ChunkIndex(
                chunk_length=builder.count - start,
                chunk_start_offset=start,
                compression=compression,
                compressed_size=len(data),
                message_start_time=0,
                message_end_time=10,
                message_index_length=0,
                message_index_offsets={1: 0},
                uncompressed_size=100,
            )
        )
    DataEnd(data_section_crc=0).write(builder)
    summary_start = builder.count
    Schema(id=1, name="std_msgs/msg/Empty", encoding="ros2msg", data=b"").write(builder)
    Channel(id=1, topic="/pose", message_encoding="cdr", schema_id=1, metadata={}).write(builder)
    for index in indexes:
        index.write(builder)
    Statistics(
        attachment_count=0,
        channel_count=1,
        channel_message_counts={1: 1},
        chunk_count=chunks,
        message_count=1,
        message_end_time=10,
        message_start_time=0,
        metadata_count=0,
        schema_count=1,
    ).write(builder)
    Footer(summary_start=summary_start, summary_offset_start=0, summary_crc=0).write(builder)
    builder.write(MCAP_MAGIC)
    path.write_bytes(builder.end())


@pytest.mark.parametrize(
    "read", [read_recording, read_part, open_log, read_logs], ids=lambda read: read.__name__
)
@pytest.mark.parametrize(
    ("chunks", "unpacked", "compression"),
    [(1, 3_000_000_000, "zstd"), (1, 300_000_000, "lz4"), (40, 100_000_000, "zstd")],
)
def test_a_recording_that_unpacks_to_gigabytes_is_refused(
    tmp_path: Path, read: Callable[[Path], object], chunks: int, unpacked: int, compression: str
) -> None:
    path = tmp_path / "bomb.mcap"
    write_mcap(path, chunks, unpacked, compression)
    assert path.stat().st_size < 5_000_000
    assert "unpacks to more than" in refused(read, path)


@pytest.mark.parametrize("read", [read_recording, read_part])
def test_a_recording_that_unpacks_to_millions_of_records_is_refused(
    tmp_path: Path, read: Callable[[Path], object]
) -> None:
    path = tmp_path / "bomb.mcap"
    write_mcap(path, 40, 100_000_000, "zstd", records=True)
    assert "unpacks to more records than" in refused(read, path)


def test_a_recording_that_unpacks_to_gigabytes_is_not_repaired(tmp_path: Path) -> None:
    path = tmp_path / "bomb.mcap.part"
    write_mcap(path, 1, 300_000_000, "zstd")
    before = path.read_bytes()
    assert "unpacks to more than" in refused(repair, path)
    assert [each.name for each in tmp_path.iterdir()] == [path.name]
    assert path.read_bytes() == before


@pytest.mark.parametrize("read", [load_config, World.load, load_scenario, load_campaign])
@pytest.mark.parametrize(
    "text", ["x = " + "9" * 5000, "x = " + "9" * 400, "x = " + "[" * 5000, "x" + ".x" * 5000 + " = 1"]
)
def test_toml_with_huge_numbers_or_deep_nesting_is_refused(
    tmp_path: Path, read: Callable[[Path], object], text: str
) -> None:
    path = tmp_path / "a.toml"
    path.write_text(text)
    assert "a.toml" in refused(read, path)


def test_a_key_with_a_line_break_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text('"a\\n\\u001b[2Jb" = 1')
    assert refused(load_config, path).isprintable()
