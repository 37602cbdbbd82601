"""Run memory-hungry work in subprocesses, which free their memory when they exit."""

import hashlib
import subprocess
import sys
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path

from thumper.common.errors import ThumperError
from thumper.offline import compile_kernels
from thumper.slam.factory import Method
from thumper.slam.scan_matching.correlative import correlative_search

KERNEL_PACKAGES = ("common", "lidar", "maps", "slam")  # the packages that define a mapper's kernels
MAX_ROUNDS = 12  # of compilation, in case the cache is not writable; five to seven are enough

PLOT = (
    "import sys; from pathlib import Path; import numpy as np; "
    "from thumper.maps.map_server_io import load_map; from thumper.maps.plot import plot_map; "
    "map_yaml, path_csv, png, title = sys.argv[1:]; "
    "path = np.loadtxt(path_csv, delimiter=',', skiprows=1, usecols=(1, 2), ndmin=2); "
    "plot_map(load_map(Path(map_yaml)), path, Path(png), title)"
)


def plot_in_subprocess(yaml_path: Path, path_csv: Path, png_path: Path, title: str) -> None:
    """Draw a saved map and a path; matplotlib alone takes 60 MB.

    Raises
    ------
    ThumperError
        The picture cannot be drawn or written.
    """
    arguments = [str(yaml_path), str(path_csv), str(png_path), title]
    done = subprocess.run(
        [sys.executable, "-c", PLOT, *arguments], check=False, capture_output=True, text=True
    )
    if done.returncode != 0:
        reason = done.stderr.strip().splitlines()[-1:] or ["no error message"]
        raise ThumperError(f"{png_path}: cannot draw the map ({reason[0]}); the map itself is saved")


def compile_in_subprocess(method: Method) -> None:
    """Fill the disk cache with the method's kernels, unless it is up to date with the sources.

    Ignores failures: the warm-up compiles what is missing.
    """
    stats = getattr(correlative_search.compiled, "stats", None)
    if stats is None:
        return  # the compiler is disabled
    done = Path(stats.cache_path) / f"{method}-{_sources()}.compiled"
    if done.exists():
        return
    command = [sys.executable, "-m", compile_kernels.__name__, method]
    for _ in range(MAX_ROUNDS):
        code = subprocess.run(command, check=False, capture_output=True).returncode
        if code != compile_kernels.INCOMPLETE:
            break
    if code == 0:
        with suppress(OSError):
            for old in done.parent.glob(f"{method}-*.compiled"):
                old.unlink(missing_ok=True)
            done.touch()


def _sources() -> str:
    """Return a hash of the compiler's version and of all sources that contain kernels."""
    package = Path(__file__).parents[1]
    sources = sorted(path for name in KERNEL_PACKAGES for path in (package / name).rglob("*.py"))
    states = [(path.name, path.stat().st_mtime_ns, path.stat().st_size) for path in sources]
    return hashlib.sha256(repr((version("numba"), states)).encode()).hexdigest()[:16]
