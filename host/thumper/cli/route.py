"""Read a route: a TOML file of waypoints, what the robot does at each, and rounds."""

from pathlib import Path

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.strict_toml import read_tables
from thumper.maps.annotations import Annotations, annotations_path, load_annotations
from thumper.maps.map_server_io import load_datum
from thumper.runtime.drive.waypoint_requests import parse_waypoints
from thumper.runtime.drive.waypoints import Waypoints


def load_route(path: Path, saved_map: Path | None, session: Path | None) -> Waypoints:
    """Return the waypoints of a route; its names are places of the map or session that the robot starts with.

    Raises
    ------
    ThumperError
        The file cannot be read, or a waypoint is wrong.
    """
    annotated = saved_map or session
    annotations = load_annotations(annotations_path(annotated)) if annotated else Annotations()
    content = read_tables(path, "route")
    try:
        return parse_waypoints(content, annotations, load_datum(saved_map) if saved_map else None)
    except ThumperError as error:
        raise ThumperError(f"{path}: {error}", exit_code=EXIT_USAGE) from error
