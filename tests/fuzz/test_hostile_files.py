"""Pipes, devices, files that are or unpack to far too much: refused at once, in one line."""

import gzip
import json
import os
import threading
import zlib
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.fuzz.mutate import with_valid_checksum
from tests.fuzz.readers import YAML, Reader, readers, write_grid
from thumper.common.errors import ThumperError
from thumper.config.robot import load_config
from thumper.maps.map_server_io import load_map
from thumper.offline.open_log import open_log
from thumper.slam.saved_state import load_session
from thumper_hil.campaign.spec import load_campaign
from thumper_hil.faults.scenario import load_scenario
from thumper_hil.world.world import World

READ_S = 30.0  # on a busy machine; a reader that waits on a pipe never ends


def refused(read: Callable[[Path], object], path: Path) -> str:
    """Return the error; fail if the reader does anything else, or waits."""
    messages: list[str] = []

    def run() -> None:
        with pytest.raises(ThumperError) as caught:
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


def test_a_session_that_unpacks_to_4_GB_is_refused(tmp_path: Path) -> None:
    header = {
        "thumper_session": 2,
        "shape": [10, 10],
        "first_cell": [0, 0],
        "resolution_m": 0.05,
        "pose": None,
        "sha256": "",
    }
    packer = zlib.compressobj(9, wbits=-15)
    block = packer.compress(bytes(10_000_000)) + packer.flush(zlib.Z_FULL_FLUSH)
    payload = b"\x78\xda" + 400 * block
    path = tmp_path / "bomb.session"
    path.write_bytes(with_valid_checksum(json.dumps(header).encode() + b"\n" + payload))
    assert "not a mapping session" in refused(lambda path: load_session(path, 0.05), path)


@pytest.mark.parametrize("start", [b"", b"FLASER 2 1.0 1.0 ", b"\x89MCAP0\r\n"])
def test_a_log_that_unpacks_to_one_line_of_4_GB_is_refused(tmp_path: Path, start: bytes) -> None:
    path = tmp_path / "bomb.log.gz"
    path.write_bytes(gzip.compress(start) + 400 * gzip.compress(b"1" * 10_000_000))
    refused(open_log, path)


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
