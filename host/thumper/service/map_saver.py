"""The command `save_map`: the file is written in a thread, for a slow disk must not make the loop wait."""

import threading
from collections.abc import Callable
from pathlib import Path

from thumper.errors import ThumperError
from thumper.mapping.grid import OccupancyGrid
from thumper.mapping.map_io import save_map


class MapSaver:
    """Call it to have the map of this moment written to one place."""

    def __init__(
        self, grid: Callable[[], OccupancyGrid], path: Path, say: Callable[[str, bool], None]
    ) -> None:
        """`say` is told by the thread what came of it, and whether that is good."""
        self._grid, self._path, self._say = grid, path, say
        self._thread: threading.Thread | None = None

    def __call__(self) -> str:
        """Begin; returns at once what is done, in words. Raises ThumperError while one is being written."""
        if self._thread is not None and self._thread.is_alive():
            raise ThumperError("the map is being saved already")
        # No daemon: a process that ends lets the file be whole first.
        self._thread = threading.Thread(target=self._save, args=(self._grid(),), name="map-saver")
        self._thread.start()
        return f"the map is being saved to {self._path}"

    def _save(self, grid: OccupancyGrid) -> None:
        try:
            self._say(f"map saved: {save_map(grid, self._path)}", True)
        except (ThumperError, OSError) as error:
            self._say(f"the map was not saved: {error}", False)
