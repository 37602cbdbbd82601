"""Lets the tests of this folder import their shared helpers by the same name that mypy knows them by."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))
