"""Optional dependencies: which commands need them, and how to install them."""

import sys
from importlib.util import find_spec

from thumper.common.errors import EXIT_CHECK_FAILED, ThumperError

EXTRAS = {  # extra of pyproject.toml: the feature it serves, the modules it installs
    "ui": ("the dashboard", ("nicegui", "cryptography")),
    "gamepad": ("a gamepad", ("pygame",)),
    "foxglove": ("Foxglove", ("foxglove", "cryptography")),
    "camera": ("the camera", ("cv2", "pyapriltags")),
    "objects": ("a detector of objects", ("cv2", "pyapriltags", "onnxruntime")),
    "notebooks": ("a live picture", ("IPython",)),
    "campaign": ("a campaign", ("distributed", "dask")),
}


def require_extra(extra: str) -> None:
    """Raise ThumperError if a module of the extra is not installed. Call it before any other work."""
    for module in EXTRAS[extra][1]:
        if find_spec(module) is None:
            raise missing_package(extra, module)


def extra_providing(module: str) -> str | None:
    """Return the extra that installs `module`."""
    top = module.partition(".")[0]
    return next((extra for extra, (_, modules) in EXTRAS.items() if top in modules), None)


def missing_package(extra: str, module: str) -> ThumperError:
    """Return the error for a missing module, with the command that installs the extra.

    pip takes the packages from the metadata of the installed Thumper, and does not ask an index for it.
    """
    reason = f"{EXTRAS[extra][0]} needs {module.partition('.')[0]}, which is not installed"
    return ThumperError(
        f"{reason}: {sys.executable} -m pip install 'thumper-robot[{extra}]'", exit_code=EXIT_CHECK_FAILED
    )
