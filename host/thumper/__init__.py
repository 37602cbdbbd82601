"""The brain of a differential-drive robot: `Robot`, `ThumperError`."""

from thumper.common.errors import ThumperError
from thumper.common.version import __version__

TYPE_CHECKING = False  # of `typing`, which takes longer to import than all that stands before the command
if TYPE_CHECKING:
    from thumper.robot import Robot

__all__ = ["Robot", "ThumperError", "__version__"]


def __getattr__(name: str) -> object:
    """`from thumper import Robot` loads what a robot takes; `import thumper` alone stays quick."""
    if name == "Robot":
        from thumper.robot import Robot

        return Robot
    raise AttributeError(f"module 'thumper' has no attribute {name!r}")
