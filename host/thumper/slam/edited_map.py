"""Save an edited map with what belongs to it: session, zones and places."""

from pathlib import Path

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.maps.annotations import Annotations, annotations_path, save_annotations
from thumper.maps.hit_counts import HitCounts
from thumper.maps.map_server_io import save_map
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.slam.saved_state import SavedSlamState, load_session, save_session


def save_edited_map(
    original: Path, out: Path, grid: OccupancyGrid, annotations: Annotations, *, rotation_rad: float
) -> list[str]:
    """Write `out`, a .yaml, with image, session, zones and places; return the names of the latter files.

    The session keeps the robot's pose of the `original`, rotated about the map's origin.

    Raises
    ------
    ThumperError
        A file cannot be written.
    """
    pose = _saved_pose(original, grid.resolution_m, rotation_rad)
    image = save_map(grid, out)
    session = save_session(
        SavedSlamState(counts=HitCounts.from_grid(grid), map_from_base=pose), out.with_suffix(".session")
    )
    return [image.name, session.name, *save_annotations(annotations, annotations_path(out))]


def _saved_pose(original: Path, resolution_m: float, rotation_rad: float) -> Pose2 | None:
    """Return the robot pose of the session beside the map, in the rotated map; None without one."""
    try:
        pose = load_session(original.with_suffix(".session"), resolution_m).map_from_base
    except ThumperError:  # no session, or an unusable one
        return None
    return Pose2(theta_rad=rotation_rad) @ pose if pose else None
