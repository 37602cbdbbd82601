"""A world in time: things that appear and go, and people who walk to and fro."""

from dataclasses import replace

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_hil.world.pedestrian import Pedestrian, Timed
from thumper_hil.world.segment_raycast import polygon_clearance_m
from thumper_hil.world.world import World, box_corners, box_sides

NO_SEGMENTS = np.zeros((0, 4))


class Scene:
    """Step it as time passes; `world` is what is there now.

    People stop before they would walk into the robot's hull, and that counts: `bumps` is how often one has.
    """

    def __init__(self, world: World) -> None:
        self._fixed = world
        self._people = [_Person(walker) for walker in world.walkers]
        self._present: tuple[Timed, ...] = ()
        self._stood_m = np.zeros((0, 3))
        self.bumps = 0
        self.world = world
        if self.changes:
            self._present = _present(world.timed, 0.0)
            self.world = self._composed()

    @property
    def changes(self) -> bool:
        """Whether anything ever appears, goes or moves."""
        return bool(self._fixed.timed or self._people)

    def stand(self, circles_m: FloatArray) -> None:
        """Have these posts, shape (n, 3), stand from now on, in place of those stood up before."""
        self._stood_m = circles_m
        self.world = self._composed()

    def step(self, time_s: float, elapsed_s: float, hull_m: FloatArray) -> bool:
        """Let time pass up to `time_s` round the robot's outline, shape (k, 2). True: the world changed."""
        if not self.changes:
            return False
        present = _present(self._fixed.timed, time_s)
        appeared, self._present = present != self._present, present
        moved = [person.step(time_s, elapsed_s, hull_m) for person in self._people]
        self.bumps += sum(person.bumped_now for person in self._people)
        if appeared or any(moved):
            self.world = self._composed()
            return True
        return False

    def _composed(self) -> World:
        """What stands for good, what is there now, and the people where they are."""
        boxes = tuple(box_corners(*thing.box) for thing in self._present if thing.box)
        circles = [thing.circle for thing in self._present if thing.circle]
        circles += [(*person.place_m, person.walker.radius_m) for person in self._people]
        return replace(
            self._fixed,
            segments_m=np.vstack([self._fixed.segments_m, *(box_sides(box) for box in boxes)]),
            circles_m=np.vstack([self._fixed.circles_m, self._stood_m, np.reshape(circles, (-1, 3))]),
            boxes_m=self._fixed.boxes_m + boxes,
        )


class _Person:
    """Where somebody is on the way to and fro."""

    def __init__(self, walker: Pedestrian) -> None:
        self.walker = walker
        steps_m = np.hypot(*np.diff(walker.waypoints_m, axis=0).T)
        self._along_m = np.concatenate([[0.0], np.cumsum(steps_m)])
        self._walked_m = 0.0
        self._waits = False
        self.bumped_now = False
        self.place_m = self._place(0.0)

    def step(self, time_s: float, elapsed_s: float, hull_m: FloatArray) -> bool:
        """Walk on unless the robot stands in the way; returns whether the person has moved."""
        self.bumped_now = False
        if time_s < self.walker.from_s:
            return False
        walked_m = self._walked_m + self.walker.speed_m_s * elapsed_s
        place_m = self._place(walked_m)
        circle = np.array([[*place_m, self.walker.radius_m]])
        blocked = polygon_clearance_m(hull_m, NO_SEGMENTS, circle) <= 0.0
        self.bumped_now = blocked and not self._waits
        self._waits = blocked
        if blocked:
            return False
        self._walked_m, self.place_m = walked_m, place_m
        return True

    def _place(self, walked_m: float) -> tuple[float, float]:
        length_m = self._along_m[-1]
        there_and_back_m = walked_m % (2.0 * length_m)
        along_m = min(there_and_back_m, 2.0 * length_m - there_and_back_m)
        x_m, y_m = (np.interp(along_m, self._along_m, self.walker.waypoints_m[:, axis]) for axis in (0, 1))
        return float(x_m), float(y_m)


def _present(timed: tuple[Timed, ...], time_s: float) -> tuple[Timed, ...]:
    return tuple(thing for thing in timed if thing.from_s <= time_s < thing.until_s)
