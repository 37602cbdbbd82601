"""The command `save_map`: the files are written in a thread, for a slow disk must not make the loop wait."""

import threading
from collections.abc import Callable
from pathlib import Path

from thumper.common.errors import ThumperError
from thumper.maps.map_server_io import save_map
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.slam.saved_state import SavedSlamState, save_session

SAVED, NOT_SAVED = "map saved: ", "the map was not saved: "  # how what is told begins


class MapSaver:
    """Call it to have the map of this moment, and the session to go on with, written to one place."""

    def __init__(
        self,
        grid: Callable[[], OccupancyGrid],
        session: Callable[[], SavedSlamState],
        path: Path,
        say: Callable[[str, bool], None],
    ) -> None:
        """`path` is the map's .yaml; `say` is told by the thread what came of it, and whether it is good."""
        self._grid, self._session, self._path, self._say = grid, session, path, say
        self._thread: threading.Thread | None = None

    def __call__(self) -> str:
        """Begin; returns at once what is done, in words. Raises ThumperError while one is being written."""
        if self._thread is not None and self._thread.is_alive():
            raise ThumperError("the map is being saved already")
        # No daemon: a process that ends lets the file be whole first.
        self._thread = threading.Thread(
            target=self._save, args=(self._grid(), self._session()), name="map-saver"
        )
        self._thread.start()
        return f"the map is being saved to {self._path}"

    def _save(self, grid: OccupancyGrid, session: SavedSlamState) -> None:
        try:
            image = save_map(grid, self._path)
            counts = save_session(session, self._path.with_suffix(".session"))
            self._say(f"{SAVED}{image}, {self._path.name}, {counts.name}", True)
        except (ThumperError, OSError) as error:
            self._say(f"{NOT_SAVED}{error}", False)
