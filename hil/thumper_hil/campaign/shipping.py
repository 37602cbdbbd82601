"""Send this installation of Thumper to Dask workers: they need its requirements, but not Thumper itself.

Workers unpickle class and function of this module without importing it. Its top imports nothing of Thumper.
"""

import hashlib
import io
import pickle
import sys
import zipfile
from collections.abc import Callable
from importlib import import_module, metadata
from pathlib import Path
from typing import Any

import cloudpickle
from distributed import WorkerPlugin

DISTRIBUTION = "thumper-robot"
PACKAGES = ("thumper", "thumper_hil", "thumper_tuning")
BOARDS = ("trex", "nano")

cloudpickle.register_pickle_by_value(sys.modules[__name__])


class ShippedPackage(WorkerPlugin):
    """Unpacks an archive of `pack` on each worker, also on those that start later, and imports from there."""

    idempotent = True

    def __init__(self, archive: bytes) -> None:
        self.archive = archive
        self.name = "thumper-" + hashlib.sha256(archive).hexdigest()[:16]

    def setup(self, worker: Any) -> None:
        """Called by Dask. Raises RuntimeError if a requirement of Thumper is missing there."""
        folder = Path(worker.local_directory) / self.name
        if not folder.is_dir():
            part = folder.with_suffix(".part")
            with zipfile.ZipFile(io.BytesIO(self.archive)) as archive:
                archive.extractall(part)
            part.rename(folder)
        missing = _missing(folder)
        if missing:
            raise RuntimeError(
                f"worker {worker.name} lacks {', '.join(missing)}; install them there with pip"
            )
        # Another Thumper may be installed there, or be left from an earlier campaign.
        sys.path[:] = [
            str(folder),
            *(path for path in sys.path if not Path(path).name.startswith("thumper-")),
        ]
        for name in [name for name in sys.modules if name.split(".")[0] in PACKAGES]:
            if not str(getattr(sys.modules[name], "__file__", "")).startswith(str(folder)):
                del sys.modules[name]


def pack() -> bytes:
    """Return a zip file of this Thumper as a wheel contains it, with firmware, simulated chip and kernels."""
    from thumper.board.firmware_image import firmware_image
    from thumper_hil.chip.native_library import LIBRARY

    files: dict[str, Path] = {}
    for name in PACKAGES:
        folder = Path(str(import_module(name).__file__)).parent
        for path in sorted(folder.rglob("*")):
            inside = path.relative_to(folder)
            if path.is_file() and not {"__pycache__", "build"} & set(inside.parts):
                files[f"{name}/{inside}"] = path
        if LIBRARY.is_relative_to(folder):
            files[f"{name}/{LIBRARY.relative_to(folder)}"] = LIBRARY
    for board in BOARDS:
        for suffix in ("elf", "hex"):
            files[f"thumper/images/{board}/thumper.{suffix}"] = firmware_image(board, suffix)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, path in files.items():
            archive.writestr(zipfile.ZipInfo(name), path.read_bytes(), zipfile.ZIP_DEFLATED)
        for name in ("METADATA", "entry_points.txt"):  # the port sim:// is an entry point
            content = metadata.distribution(DISTRIBUTION).read_text(name) or ""
            archive.writestr(zipfile.ZipInfo(f"thumper_robot.dist-info/{name}"), content)
    return stream.getvalue()


def shipped_job() -> Callable[[bytes], bytes]:
    """Return the task of a worker: it takes a job as bytes and returns the row as bytes.

    Dask sends a function inside a function by value, and the scheduler cannot look into bytes.
    """

    def run(job: bytes) -> bytes:
        from thumper_hil.campaign.job import run_job

        return pickle.dumps(run_job(pickle.loads(job)))

    return run


def _missing(folder: Path) -> list[str]:
    """Return the requirements of the Thumper in `folder`, less extras, that are not installed."""
    missing = []
    (thumper,) = metadata.distributions(path=[str(folder)])
    for requirement in thumper.requires or ():
        if "extra ==" in requirement:
            continue
        name = requirement.replace(";", " ").replace("<", " ").replace(">", " ").replace("=", " ").split()[0]
        try:
            metadata.distribution(name)
        except metadata.PackageNotFoundError:
            missing.append(name)
    return missing
