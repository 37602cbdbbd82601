"""Check whether a generator's output is up to date."""

import subprocess
import sys
from pathlib import Path


def check(generator: Path) -> subprocess.CompletedProcess[str]:
    """Run `generator --check`, which exits with 1 and names the stale files."""
    return subprocess.run(
        [sys.executable, str(generator), "--check"], capture_output=True, text=True, check=False
    )
