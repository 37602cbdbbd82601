"""Ask a generator whether what it wrote is still what it would write."""

import subprocess
import sys
from pathlib import Path


def check(generator: Path) -> subprocess.CompletedProcess[str]:
    """Run `generator --check`; it exits 1 and names what is stale."""
    return subprocess.run(
        [sys.executable, str(generator), "--check"], capture_output=True, text=True, check=False
    )
