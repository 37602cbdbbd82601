"""Packages that only some commands need: pyproject.toml's optional dependencies, and how to get one."""

import sys
from importlib.metadata import requires
from importlib.util import find_spec

from thumper.common.errors import EXIT_CHECK_FAILED, ThumperError

EXTRAS = {  # what an extra is for, and the modules that it brings
    "ui": ("the page", ("nicegui", "cryptography")),
    "gamepad": ("a gamepad", ("pygame",)),
    "rosbridge": ("rosbridge", ("websockets",)),
    "campaign": ("a campaign", ("distributed", "dask", "pyarrow")),
}


def require_extra(extra: str) -> None:
    """Refuse, before anything is done, when a module of the extra is missing; raises ThumperError."""
    for module in EXTRAS[extra][1]:
        if find_spec(module) is None:
            raise missing_package(extra, module)


def extra_providing(module: str) -> str | None:
    """Which extra brings the module."""
    top = module.partition(".")[0]
    return next((extra for extra, (_, modules) in EXTRAS.items() if top in modules), None)


def missing_package(extra: str, module: str) -> ThumperError:
    """The module in words, with the packages to install: by their names, as thumper itself is on no index."""
    ours = [line.split(";")[0].strip() for line in requires("thumper") or [] if _is_of(line, extra)]
    packages = " ".join(f"'{package}'" for package in ours)
    what = f"{EXTRAS[extra][0]} needs {module.partition('.')[0]}, which is not installed"
    return ThumperError(f"{what}: {sys.executable} -m pip install {packages}", exit_code=EXIT_CHECK_FAILED)


def _is_of(requirement: str, extra: str) -> bool:
    """Whether metadata's line, such as "pygame>=2.6; extra == 'gamepad'", belongs to the extra."""
    return requirement.partition(";")[2].replace('"', "'").strip() == f"extra == '{extra}'"
