"""`--map` and `--session`: load the saved map or session that a drive starts with."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from thumper.config.robot import RobotConfig
    from thumper.maps.occupancy_grid import OccupancyGrid
    from thumper.slam.saved_state import SavedSlamState


def load_start_map(
    settings: "RobotConfig", saved_map: Path | None, session: Path | None
) -> "OccupancyGrid | SavedSlamState | None":
    """Load the given map or session; print where a session was saved and which mapper continues it.

    Raises
    ------
    ThumperError
        Both are given, or the file cannot be used.
    """
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.common.texts import place_text
    from thumper.maps.map_server_io import load_map
    from thumper.slam.saved_state import load_session

    if saved_map is not None and session is not None:
        raise ThumperError(
            "--map keeps a map unchanged, --session resumes mapping: pass only one",
            exit_code=EXIT_USAGE,
        )
    if saved_map is not None:
        return load_map(saved_map)
    if session is None:
        return None
    known = load_session(session, settings.mapping.resolution_m)
    if pose := known.map_from_base:
        place = f"{place_text(pose.x_m, pose.y_m)} m, heading {math.degrees(pose.theta_rad):z.0f} degrees"
        print(f"{session}: saved with the robot at {place}")
    if settings.mapping.method == "rbpf":
        print("note: scan_match resumes this session; rbpf would start with an empty map")
    return known
