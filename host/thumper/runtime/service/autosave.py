"""Saves session, zones and places every few seconds, so that a crash costs at most that much of the map.

A thread compresses and writes, so that a slow disk does not delay the loop.
"""

import threading
import time
from collections.abc import Callable
from pathlib import Path

from thumper.common.errors import ThumperError
from thumper.maps.annotations import Annotations, annotations_path, save_annotations
from thumper.runtime.state_estimator import StateEstimator
from thumper.slam.mapper import SwitchesMode
from thumper.slam.saved_state import SavedSlamState, save_session

PERIOD_S = 3.0
MAX_LOAD = 0.1  # of one core, for large maps


class Autosave:
    """Call `step` once per cycle. The file is complete at any time, however the process ends."""

    def __init__(
        self,
        estimator: StateEstimator,
        annotations: Callable[[], Annotations],
        path: Path,
        report: Callable[[str], None],
    ) -> None:
        """`report` receives a line, in the thread, when a save fails for the first time."""
        self._estimator, self._path, self._report = estimator, path, report
        self._annotations = annotations
        self._saved = annotations()
        self._thread: threading.Thread | None = None
        self._next_s = time.monotonic() + PERIOD_S
        self._scans = 0
        self._has_failed = False

    def step(self) -> None:
        """Begin to save if it is time, something was mapped or drawn, and no save is under way."""
        mapper, scans = self._estimator.mapper, self._estimator.scans_mapped
        if time.monotonic() < self._next_s or self._is_saving:
            return
        if scans == 0 or (scans == self._scans and self._annotations() is self._saved):
            return
        if isinstance(mapper, SwitchesMode) and mapper.is_localizing:
            return  # the map does not change, and may not be this robot's yet
        self._scans, self._saved = scans, self._annotations()
        state = self._estimator.state()
        assert state is not None  # scans were mapped
        session = SavedSlamState.from_mapper(mapper, state.map_from_base)
        self._thread = threading.Thread(
            target=self._save, args=(session, self._saved), name="autosave", daemon=True
        )
        self._thread.start()

    def close(self, *, remove: bool) -> None:
        """Wait for a save under way; `remove` the file if the map was saved otherwise."""
        if self._thread is not None:
            self._thread.join()
        if remove:
            self._path.unlink(missing_ok=True)
            annotations_path(self._path).unlink(missing_ok=True)

    @property
    def _is_saving(self) -> bool:
        return self._thread is not None and self._thread.is_alive()

    def _save(self, session: SavedSlamState, annotations: Annotations) -> None:
        begun_s = time.thread_time()
        try:
            save_session(session, self._path)
            save_annotations(annotations, annotations_path(self._path))
            self._has_failed = False
        except (ThumperError, OSError) as error:
            if not self._has_failed:
                self._report(f"the session is not saved: {error}")
            self._has_failed = True
        busy_s = time.thread_time() - begun_s
        self._next_s = time.monotonic() + max(PERIOD_S, busy_s / MAX_LOAD)
