"""Work that needs much memory for a moment, in processes of its own: the memory goes when they end."""

import hashlib
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numba

from thumper.common.errors import ThumperError
from thumper.offline import compile_kernels
from thumper.slam.factory import Method
from thumper.slam.scan_matching.correlative import correlative_search

KERNEL_PACKAGES = ("common", "lidar", "maps", "slam")  # a mapper's kernels are defined in these
MAX_ROUNDS = 12  # of compiling, in case the cache cannot be written; five to seven do it

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
        reason = done.stderr.strip().splitlines()[-1:] or ["no reason given"]
        raise ThumperError(f"{png_path}: cannot be drawn ({reason[0]}); the map itself is written")


def compile_in_subprocess(method: Method) -> None:
    """Fill the cache on disk, unless it was filled for the method from the sources as they are now.

    A failure is left to the warm-up.
    """
    cache = getattr(correlative_search, "_cache", None)  # numba offers no other way to ask for its folder
    if cache is None:
        return  # the compiler is off
    done = Path(cache.cache_path) / f"{method}-{_sources()}.compiled"
    if done.exists():
        return
    command = [sys.executable, "-m", compile_kernels.__name__, method]
    for _ in range(MAX_ROUNDS):
        code = subprocess.run(command, check=False, capture_output=True).returncode
        if code != compile_kernels.GO_ON:
            break
    if code == 0:
        with suppress(OSError):
            for old in done.parent.glob(f"{method}-*.compiled"):
                old.unlink(missing_ok=True)
            done.touch()


def _sources() -> str:
    """A name for the compiler and all sources that kernels are in, as they are now."""
    package = Path(__file__).parents[1]
    found = sorted(path for name in KERNEL_PACKAGES for path in (package / name).rglob("*.py"))
    states = [(path.name, path.stat().st_mtime_ns, path.stat().st_size) for path in found]
    return hashlib.sha256(repr((numba.__version__, states)).encode()).hexdigest()[:16]
