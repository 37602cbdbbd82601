"""The brain of a differential-drive robot.

Scripts import `Robot`, `DriveResult`, `Pose2`, `ThumperError` and its kinds from here.
"""

from thumper.common.errors import NotThereError, ThumperError, UsageError
from thumper.common.version import __version__

TYPE_CHECKING = False  # importing typing would take longer than all other imports here
if TYPE_CHECKING:
    from thumper.common.geometry import Pose2
    from thumper.robot import Robot
    from thumper.runtime.drive_result import DriveResult

__all__ = [
    "DriveResult",
    "NotThereError",
    "Pose2",
    "Robot",
    "ThumperError",
    "UsageError",
    "__version__",
]

_MODULES = {
    "DriveResult": "thumper.runtime.drive_result",
    "Pose2": "thumper.common.geometry",
    "Robot": "thumper.robot",
}


def __getattr__(name: str) -> object:
    """Import a class on first use, so that `import thumper` alone stays fast."""
    if name in _MODULES:
        from importlib import import_module

        return getattr(import_module(_MODULES[name]), name)
    raise AttributeError(f"module 'thumper' has no attribute {name!r}")
