"""The brain of a differential-drive robot: `Robot`, `ThumperError`."""

from thumper.common.errors import ThumperError
from thumper.common.version import __version__

TYPE_CHECKING = False  # importing typing would take longer than all other imports here
if TYPE_CHECKING:
    from thumper.robot import Robot

__all__ = ["Robot", "ThumperError", "__version__"]


def __getattr__(name: str) -> object:
    """Import `Robot` on first use, so that `import thumper` alone stays fast."""
    if name == "Robot":
        from thumper.robot import Robot

        return Robot
    raise AttributeError(f"module 'thumper' has no attribute {name!r}")
