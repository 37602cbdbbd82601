"""The maps that clients save under a name, and load into the running robot."""

from dataclasses import dataclass, field
from pathlib import Path

from thumper.common.errors import ThumperError
from thumper.maps.annotations import annotations_path, load_annotations
from thumper.maps.library import delete_item, list_maps, list_recordings, map_files, map_path, rename_item
from thumper.maps.map_server_io import load_datum, load_map
from thumper.ros.services import Empty, LibraryContent, LibraryItem, NamedMap, RenameItem, Text
from thumper.runtime.object_map import ObjectMap
from thumper.runtime.publisher import Publisher
from thumper.runtime.service.map_annotations import MapAnnotations
from thumper.runtime.service.map_saver import MapSaver
from thumper.runtime.service.preconditions import Preconditions
from thumper.runtime.state_estimator import StateEstimator
from thumper.slam.mode_switch import SlamModeSwitch


@dataclass(frozen=True, slots=True, kw_only=True)
class MapStorage:
    """Where the robot's maps are, and what belongs to the one in use."""

    folder: Path  # the library
    annotations: MapAnnotations
    saver: MapSaver | None  # None: this run saves its map at its end
    opened: Path | None = None  # the map or session that the run started with
    objects: ObjectMap = field(default_factory=ObjectMap)  # that a detector has seen


class MapLibrary:
    """The folder that holds the robot's maps and recordings."""

    def __init__(
        self,
        storage: MapStorage,
        *,
        estimator: StateEstimator,
        publisher: Publisher,
        preconditions: Preconditions,
    ) -> None:
        self._folder, self._saver, self._annotations = storage.folder, storage.saver, storage.annotations
        self._estimator = estimator
        self._publisher = publisher
        self._preconditions = preconditions
        self._objects = storage.objects
        self._loaded = storage.opened and storage.opened.with_suffix(".yaml")  # also of a session

    def content(self, _request: Empty, _source: str = "") -> LibraryContent:
        """List what there is."""
        return LibraryContent(
            maps=list_maps(self._folder),
            recordings=list_recordings(self._folder),
            in_use=map_in_use(self._loaded, self._folder, self._estimator.mapper),
        )

    def save(self, request: NamedMap, _source: str = "") -> Text:
        """Begin to save the current map; raise ThumperError if the name is taken or none."""
        path = map_path(self._folder, request.name)
        if self._saver is None:
            raise ThumperError("this run saves its map at its end; `thumper run` without a goal serves maps")
        if map_files(path):
            raise ThumperError(f"there is a map {request.name!r} already: choose another name")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ThumperError(f"{self._folder}: cannot be created ({error.strerror})") from error
        return self._say(self._saver.save_to(path))

    def load(self, request: NamedMap, _source: str = "") -> Text:
        """Localize in a saved map, with its zones; raise ThumperError if that is impossible now."""
        self._preconditions.require_serving("other maps")
        self._preconditions.require_stationary("load a map")
        path, mapper = map_path(self._folder, request.name), self._estimator.mapper
        if not path.exists():
            raise ThumperError(f"there is no map {request.name!r} in {self._folder}")
        if not isinstance(mapper, SlamModeSwitch):
            raise ThumperError("this robot's mapper cannot localize in a saved map")
        self._preconditions.prepare_map_change(f"loaded map {request.name!r}")
        grid, annotations = load_map(path), load_annotations(annotations_path(path))
        datum = load_datum(path)
        mapper.localize_in(grid, None)
        self._estimator.change_datum(datum)
        self._annotations.replace(annotations)
        self._objects.clear()
        self._loaded = path
        return self._say(f"loaded map {request.name!r}; the robot searches it for its pose")

    def rename(self, request: RenameItem, _source: str = "") -> Text:
        """Rename a map or recording; raise ThumperError if that is impossible."""
        self._require_closed(request.name)
        rename_item(self._folder, request.name, request.new_name)
        return self._say(f"renamed {request.name} to {request.new_name}")

    def delete(self, request: LibraryItem, _source: str = "") -> Text:
        """Delete a map or recording; raise ThumperError if that is impossible."""
        self._preconditions.require_stationary("delete files")  # a large recording delays the control cycle
        self._require_closed(request.name)
        delete_item(self._folder, request.name)
        return self._say(f"deleted {request.name}")

    def _require_closed(self, name: str) -> None:
        """Raise ThumperError for the map in use or being written. An unfinished recording has no name yet."""
        path = map_path(self._folder, name)
        if self._loaded is not None and path.resolve() == self._loaded.resolve():
            raise ThumperError(f"the robot uses the map {name}: load another one first")
        if self._saver is not None and path == self._saver.writes_to:
            raise ThumperError(f"the map {name} is being written; wait until that is done")

    def _say(self, line: str) -> Text:
        self._publisher.publish_event(line)
        return Text(text=line)


def map_in_use(loaded: Path | None, folder: Path, mapper: object) -> str:
    """Return the map of the library in which the robot localizes; empty while it maps or has another."""
    if loaded is None or not isinstance(mapper, SlamModeSwitch) or not mapper.is_localizing:
        return ""
    return loaded.stem if loaded.resolve() == map_path(folder, loaded.stem).resolve() else ""
