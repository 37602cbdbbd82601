"""libFuzzer on parser, supervisor, monitors and parameters, with address and undefined-behaviour sanitizers.

For a longer run: `tests/firmware/build/fuzz -max_len=256 tests/firmware/fuzz/corpus`.
"""

import shutil
import subprocess
from pathlib import Path

from tests.firmware.conftest import BUILD, FIRMWARE, HERE, build

CORPUS = HERE / "fuzz" / "corpus"
SECONDS = 8


def test_no_bytes_break_the_firmware(tmp_path: Path) -> None:
    """Starts from a copy of the corpus, so new inputs stay out of the repository."""
    corpus = tmp_path / "corpus"
    shutil.copytree(CORPUS, corpus)
    assert any(corpus.iterdir())
    fuzzer = build(
        BUILD / "fuzz",
        ["clang++", "-std=c++14", "-O1", "-g", "-Wall", "-Wextra", "-Werror"],
        [HERE / "fuzz/fuzz.cpp"],
        ["-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all", f"-I{FIRMWARE}"],
    )
    result = subprocess.run(
        [str(fuzzer), f"-max_total_time={SECONDS}", "-max_len=256", "-seed=1", str(corpus)],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
    )
    assert result.returncode == 0, result.stderr[-3000:]
    assert "Done" in result.stderr
