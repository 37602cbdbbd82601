"""Lets the tests of this folder import their shared helpers by the name that mypy knows them by."""

import os
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))


@pytest.fixture(scope="session")
def nav_data() -> Path:
    """The folder of recorded maps and oracle files."""
    folder = Path(os.environ.get("THUMPER_DATA", ROOT.parent / "shared" / "data")) / "nav"
    if not folder.is_dir():
        pytest.skip(f"no recorded navigation data in {folder}: set THUMPER_DATA")
    return folder
