"""A file that is not what a command reads gives exit status 2, whichever command it is."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.host.cli.conftest import Ended
from thumper.common import optional_packages
from thumper.common.errors import EXIT_USAGE

Run = Callable[..., Ended]


@pytest.mark.parametrize("content", [b"[broken\n", b"\x00\xff\x80\x01", None])
@pytest.mark.parametrize(
    "command",
    [
        "tune fit FILE --counts-per-rev 4800",
        "tune design FILE --counts-per-rev 4800",
        "map-log FILE",
        "replay FILE",
        "recover FILE",
        "export FILE --csv tables",
        "doctor --config FILE",
        "run --board sim:// --map FILE --goal 1 0",
        "run --board sim:// --session FILE --goal 1 0",
        "run --board sim:// --route FILE",
        "plan FILE --start 0 0 --goal 1 0",
        "edit FILE --rotate 90 --out new.yaml",
        "campaign FILE",
    ],
)
def test_a_wrong_file(thumper: Run, tmp_path: Path, command: str, content: bytes | None) -> None:
    path = tmp_path / "wrong"
    if content is not None:
        path.write_bytes(content)
    ended = thumper(*(str(path) if word == "FILE" else word for word in command.split()))
    assert ended.status == EXIT_USAGE, ended.err
    (line,) = ended.err.splitlines()
    assert path.name in line


@pytest.mark.parametrize("content", [b"[broken\n", None])
def test_a_wrong_campaign_is_refused_before_missing_packages(
    thumper: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: bytes | None
) -> None:
    monkeypatch.setitem(optional_packages.EXTRAS, "campaign", ("a campaign", ("no_such_module",)))
    path = tmp_path / "wrong.toml"
    if content is not None:
        path.write_bytes(content)
    ended = thumper("campaign", str(path))
    assert ended.status == EXIT_USAGE, ended.err
    assert "wrong.toml" in ended.err
