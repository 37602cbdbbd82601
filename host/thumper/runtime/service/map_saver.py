"""The command `save_map`. A thread writes the files, so that a slow disk does not delay the loop."""

import threading
from collections.abc import Callable
from pathlib import Path

from thumper.common.errors import ThumperError
from thumper.gps.earth_reference import MapDatum
from thumper.maps.annotations import Annotations, annotations_path, save_annotations
from thumper.maps.map_server_io import save_map
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.slam.saved_state import SavedSlamState, save_session

SAVED, NOT_SAVED = "map saved: ", "the map was not saved: "  # prefixes of the two reports


class MapSaver:
    """Call it to write map, session, zones and places to one folder."""

    def __init__(
        self,
        grid: Callable[[], OccupancyGrid],
        session: Callable[[], SavedSlamState],
        annotations: Callable[[], Annotations],
        path: Path,
        report: Callable[[str, bool], None],
        *,
        datum: Callable[[], MapDatum | None] = lambda: None,
        before_save: Callable[[], None] = lambda: None,
    ) -> None:
        """`path` is the map's .yaml. The thread calls `before_save` before it writes there, and
        `report(text, ok)` with the outcome.
        """
        self._grid, self._session, self._annotations = grid, session, annotations
        self._path, self._report, self._datum = path, report, datum
        self._before_save = before_save
        self._thread: threading.Thread | None = None
        self._target = path  # of the newest write

    @property
    def writes_to(self) -> Path | None:
        """The .yaml that is being written; None if none is."""
        return self._target if self._thread is not None and self._thread.is_alive() else None

    def __call__(self) -> str:
        """Start to write and return a description at once; raise ThumperError if a write is running."""
        return self.save_to(self._path)

    def save_to(self, path: Path) -> str:
        """Like a call, to another .yaml."""
        if self._thread is not None and self._thread.is_alive():
            raise ThumperError("the map is being saved already; wait until it is written")
        self._target = path
        # Not a daemon: the process must not end with half a file.
        content = (path, self._grid(), self._session(), self._annotations(), self._datum())
        self._thread = threading.Thread(target=self._save, args=content, name="map-saver")
        self._thread.start()
        return f"saving the map to {path}"

    def _save(
        self,
        path: Path,
        grid: OccupancyGrid,
        session: SavedSlamState,
        annotations: Annotations,
        datum: MapDatum | None,
    ) -> None:
        try:
            if path == self._path:
                self._before_save()
            image = save_map(grid, path, datum)
            counts = save_session(session, path.with_suffix(".session"))
            zones = save_annotations(annotations, annotations_path(path))
            names = ", ".join((str(image), path.name, counts.name, *zones))
            self._report(f"{SAVED}{names}", True)
        except (ThumperError, OSError) as error:
            self._report(f"{NOT_SAVED}{error}", False)
