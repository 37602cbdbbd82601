"""The session of a run that crashed is kept, and named."""

from pathlib import Path

import pytest

from thumper.cli.resume import AUTOSAVE, INTERRUPTED, keep_interrupted_session


def test_the_next_run_does_not_overwrite_the_session_of_a_crash(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    keep_interrupted_session(tmp_path)
    assert capsys.readouterr().out == ""
    (tmp_path / AUTOSAVE).write_text("map")
    keep_interrupted_session(tmp_path)
    assert (tmp_path / INTERRUPTED).read_text() == "map"
    assert not (tmp_path / AUTOSAVE).exists()
    assert f"--session {tmp_path / INTERRUPTED}" in capsys.readouterr().out
