"""Builds the documentation's site, as `make docs` does."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
PATHS = os.pathsep.join(str(ROOT / folder) for folder in ("host", "hil"))


def build_pages(folder: Path) -> Path:
    """Build the pages in an empty folder; return the folder of the site."""
    shutil.copy(ROOT / "zensical.toml", folder)
    for part in ("docs", "packaging/theme"):
        shutil.copytree(ROOT / part, folder / part)
    zensical = Path(sys.executable).with_name("zensical")
    subprocess.run([zensical, "build", "--strict"], cwd=folder, check=True, capture_output=True)
    for script in ("finish_pages.py", "search_weights.py"):
        subprocess.run([sys.executable, ROOT / "scripts" / script, folder / "site"], check=True)
    return folder / "site"


def build_robot(site: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Add the front page's robot, and the search that works from files."""
    return subprocess.run(
        [ROOT / "scripts/build-browser", site, sys.executable],
        env=os.environ | {"PYTHONPATH": PATHS} | environment,
        capture_output=True,
        text=True,
        check=False,
    )
