"""Looks for objects in the newest frame, and places them in the map.

A detector takes longer than a control cycle, so it runs in a thread. In simulation the result of a frame is
taken in the next cycle, however long the thread needs, so that runs repeat.
"""

import math
from collections.abc import Callable
from concurrent.futures import Future

from thumper.camera.detector import Detection
from thumper.camera.detector_thread import FindObjects
from thumper.camera.frame import CameraFrame
from thumper.camera.options import CameraOptions
from thumper.ros.to_ros import WARN
from thumper.runtime.object_map import ObjectMap
from thumper.runtime.object_place import View
from thumper.runtime.publisher import Publisher
from thumper.runtime.state_estimator import StateEstimator

LOOK_S = 0.5  # from frame to frame at least; a slow computer skips frames


class ObjectFinder:
    """Call `update` once per control cycle."""

    def __init__(
        self,
        find: FindObjects,
        camera: CameraOptions,
        *,
        estimator: StateEstimator,
        publisher: Publisher,
        objects: ObjectMap,
        newest_frames: Callable[[], list[CameraFrame]],
        is_simulated: bool,
    ) -> None:
        self._find, self._camera = find, camera
        self._estimator, self._publisher, self._objects = estimator, publisher, objects
        self._newest_frames, self._is_simulated = newest_frames, is_simulated
        self._running: tuple[View, int, Future[list[Detection]]] | None = None
        self._frame: CameraFrame | None = None  # waits for the odometry at its time
        self._looked_s = -math.inf
        self._has_failed = False
        self._published: list[tuple[str, float, float]] | None = None

    def update(self) -> None:
        """Take the result that is there, and start with the newest frame. On a real robot it never waits."""
        self._take()
        for frame in self._newest_frames():
            self._frame = frame
        if self._running is None and not self._has_failed:
            self._start()
        objects = [(each.label, round(each.x_m, 2), round(each.y_m, 2)) for each in self._objects.objects]
        if objects != self._published:
            self._published = objects
            self._publisher.objects = f"objects: {self._objects.summary}"
            self._publisher.publish_objects(objects)

    def _start(self) -> None:
        frame, state = self._frame, self._estimator.state()
        if frame is None or frame.time_s < self._looked_s + LOOK_S or state is None:
            return
        odom_from_base = self._estimator.odom_from_base_at(frame.time_s)
        if odom_from_base is None or not self._estimator.scans_mapped or state.lost:
            return
        self._frame, self._looked_s = None, frame.time_s
        view = View(
            time_s=frame.time_s,
            map_from_base=self._estimator.map_from_odom @ odom_from_base,
            hits_in_map_m=state.hits_in_map_m,
        )
        self._running = view, self._objects.map_number, self._find(frame)

    def _take(self) -> None:
        if self._running is None:
            return
        view, map_number, result = self._running
        if not (self._is_simulated or result.done()):
            return
        self._running = None
        try:
            found = result.result()
        except ValueError:
            return  # a damaged frame
        except Exception as error:  # of the network
            self._has_failed = True
            self._publisher.publish_event(f"no more objects are found: the detector failed: {error}", WARN)
            return
        if map_number == self._objects.map_number:  # else another map was loaded meanwhile
            self._objects.look(found, view, self._camera)
