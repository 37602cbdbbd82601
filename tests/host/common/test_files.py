"""Files that appear whole or not at all."""

import os
from pathlib import Path

import pytest

from thumper.common.files import write_text


def test_a_new_file_is_on_the_disk_with_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the folder's own sync, a power cut after the rename can bring back the old file, or none."""
    path, synced = tmp_path / "map.yaml", list[tuple[str, bool]]()
    sync = os.fsync

    def record(handle: int) -> None:
        sync(handle)
        place = Path(f"/proc/self/fd/{handle}").readlink()
        if place.is_relative_to(tmp_path):  # else it is of another thread
            synced.append((place.name, path.exists()))

    monkeypatch.setattr("thumper.common.files.os.fsync", record)
    write_text(path, "resolution: 0.05\n")
    assert synced == [("map.yaml.part", False), (tmp_path.name, True)]
