"""Fixtures of the host's tests."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def nav_data() -> Path:
    """The folder of recorded maps and oracle files."""
    folder = Path(os.environ.get("THUMPER_DATA", ROOT.parent / "shared" / "data")) / "nav"
    if not folder.is_dir():
        pytest.skip(f"no recorded navigation data in {folder}: set THUMPER_DATA")
    return folder
