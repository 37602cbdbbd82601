"""No content of a file makes a reader fail with anything but one line that names the file.

`THUMPER_FUZZ_S=600 pytest tests/fuzz` searches longer, from another seed each time. An input that fails is
kept in `corpus/`.
"""

import os
import random
import time
from pathlib import Path

import pytest

from tests.fuzz.corpus import kept, kept_if_it_fails
from tests.fuzz.mutate import mutated, with_valid_checksum
from tests.fuzz.readers import Reader, readers
from thumper.common.errors import ThumperError

SECONDS = float(os.environ.get("THUMPER_FUZZ_S", "0"))
CASES = 150  # per reader in the usual test
SLOWEST_S = 20.0  # a busy machine; the usual time is some milliseconds


@pytest.fixture(params=readers(), ids=lambda reader: str(reader.name))
def reader(request: pytest.FixtureRequest, tmp_path: Path) -> Reader:
    chosen: Reader = request.param
    chosen.beside(tmp_path)
    return chosen


def test_valid_contents_are_read(reader: Reader, tmp_path: Path) -> None:
    for content in reader.contents():
        (tmp_path / reader.file).write_bytes(content)
        reader.read(tmp_path / reader.file)


def test_a_changed_file_is_read_or_refused_in_one_line(reader: Reader, tmp_path: Path) -> None:
    path, contents = tmp_path / reader.file, reader.contents()
    rng = random.Random(time.time_ns() if SECONDS else 1)
    end_s = time.monotonic() + SECONDS
    case = 0
    while case < CASES or time.monotonic() < end_s:
        case += 1
        content = mutated(rng.choice(contents), rng)
        if reader.name == "session" and rng.random() < 0.8:
            content = with_valid_checksum(content)
        check(reader, path, content)


def test_kept_inputs_are_read_or_refused_in_one_line(reader: Reader, tmp_path: Path) -> None:
    for content in kept(reader.name):
        check(reader, tmp_path / reader.file, content)


def check(reader: Reader, path: Path, content: bytes) -> None:
    path.write_bytes(content)
    start_s = time.monotonic()
    with kept_if_it_fails(reader.name, content):
        try:
            reader.read(path)
        except ThumperError as error:
            message = str(error)
        else:
            message = ""
        assert message.isprintable()
        assert time.monotonic() - start_s < SLOWEST_S, f"{path} took too long"
