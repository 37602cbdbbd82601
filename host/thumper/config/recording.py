"""The robot's `[recording]`."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingOptions:
    """Where recordings go, how much they may take, and how much of them a crash may cost."""

    # Folder of the recordings, from where the program is started.
    folder: str = "recordings"
    # A new file is begun beyond this size [MB] ...
    file_MB: Annotated[float, Gt(0)] = 512.0
    # ... and beyond this age [s].
    file_s: Annotated[float, Gt(0)] = 3600.0
    # All recordings of this robot in the folder together [MB]: the oldest are deleted for the newest.
    budget_MB: Annotated[float, Gt(0)] = 8192.0
    # Recording stops before less than this is left on the disk for everything else [MB].
    spare_MB: Annotated[float, Ge(0)] = 256.0
