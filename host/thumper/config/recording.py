"""Options of recordings: the `[recording]` table of the robot's TOML."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingOptions:
    """Folder of the library and the size limits of its recordings."""

    # Folder of recordings and named maps, the library, relative to where the program starts.
    folder: str = "library"
    # Start a new file beyond this size [MB]; at most a quarter of the budget.
    file_MB: Annotated[float, Gt(0)] = 512.0
    # Start a new file beyond this age [s].
    file_s: Annotated[float, Gt(0)] = 3600.0
    # Total size of this robot's recordings in the folder [MB]; the oldest are deleted for the newest.
    budget_MB: Annotated[float, Gt(0)] = 8192.0
    # Pause recording while less than this is free on the disk [MB].
    spare_MB: Annotated[float, Ge(0)] = 256.0
