"""The objects that the detector has seen, as places in the map."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

from thumper.camera.detector import Detection
from thumper.camera.options import CameraOptions
from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2
from thumper.common.texts import place_text
from thumper.runtime.object_place import View, is_empty, place_of

SAME_M = 0.5  # sightings of a class that are nearer to each other show one object
SIGHTINGS = 3  # of an object, before it counts
LOOKS = 3  # in a row through the place of an object, after which it is gone
UNCERTAIN_S = 5.0  # after its last sighting, an object that does not count yet is forgotten
AVERAGED = 10  # newest sightings, about so many of which its place is the mean of
MAX_OBJECTS = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class MapObject:
    """An object: the side of it that the robot has seen."""

    label: str
    x_m: float
    y_m: float
    facing_rad: float  # direction from it to where the robot saw it from last
    count: int  # sightings
    seen_s: float  # the last one
    empty_looks: int = 0  # in a row


class ObjectMap:
    """Call `look` with the detections of a frame."""

    def __init__(self) -> None:
        self._all: list[MapObject] = []
        self.map_number = 0  # of the map in use

    @property
    def objects(self) -> tuple[MapObject, ...]:
        """The objects that have been seen often enough, in the order of their first sighting."""
        return tuple(each for each in self._all if each.count >= SIGHTINGS)

    def clear(self) -> None:
        """Forget all: another map is in use."""
        self._all = []
        self.map_number += 1

    def look(self, detections: Iterable[Detection], view: View, camera: CameraOptions) -> None:
        """Add the sightings of a frame; drop what is gone."""
        for detection in detections:
            at = place_of(detection.box_px, view, camera)
            if at is not None:
                self._see(detection.label, *at, view)
        self._all = [
            kept for each in self._all if (kept := self._still_there(each, view, camera)) is not None
        ]

    def nearest(self, label: str, to: Pose2) -> MapObject:
        """Return the nearest object of a class; raise ThumperError, which lists the classes, if unseen."""
        wanted = [each for each in self.objects if each.label.casefold() == label.strip().casefold()]
        if not wanted:
            seen = ", ".join(sorted({each.label for each in self.objects}))
            cure = f"seen so far: {seen}" if seen else "none has been seen so far"
            raise ThumperError(f"no object {label!r} on this map; {cure}", exit_code=EXIT_USAGE)
        return min(wanted, key=lambda each: math.hypot(each.x_m - to.x_m, each.y_m - to.y_m))

    @property
    def summary(self) -> str:
        """The objects in one line."""
        texts = (f"{each.label} {place_text(each.x_m, each.y_m)}" for each in self.objects)
        return ", ".join(sorted(texts)) or "none seen"

    def _see(self, label: str, x_m: float, y_m: float, view: View) -> None:
        """Add a sighting to the nearest object of its class, or a new object."""
        base = view.map_from_base
        facing_rad = math.atan2(base.y_m - y_m, base.x_m - x_m)
        near = [
            (math.hypot(each.x_m - x_m, each.y_m - y_m), index)
            for index, each in enumerate(self._all)
            if each.label == label
        ]
        distance_m, index = min(near, default=(math.inf, -1))
        if distance_m > SAME_M:
            if len(self._all) < MAX_OBJECTS:
                new = MapObject(
                    label=label, x_m=x_m, y_m=y_m, facing_rad=facing_rad, count=1, seen_s=view.time_s
                )
                self._all.append(new)
            return
        old = self._all[index]
        share = 1.0 / min(old.count + 1, AVERAGED)
        self._all[index] = replace(
            old,
            x_m=old.x_m + share * (x_m - old.x_m),
            y_m=old.y_m + share * (y_m - old.y_m),
            facing_rad=facing_rad,
            count=old.count + 1,
            seen_s=view.time_s,
        )

    @staticmethod
    def _still_there(each: MapObject, view: View, camera: CameraOptions) -> MapObject | None:
        """Return the object after a look; None if it is to be dropped."""
        if each.seen_s == view.time_s:
            return replace(each, empty_looks=0)
        if each.count < SIGHTINGS and view.time_s > each.seen_s + UNCERTAIN_S:
            return None
        empty_looks = each.empty_looks + 1 if is_empty(each.x_m, each.y_m, view, camera) else 0
        return replace(each, empty_looks=empty_looks) if empty_looks < LOOKS else None
