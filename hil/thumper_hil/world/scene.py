"""A world that changes over time: timed obstacles appear and disappear, people walk."""

import math
from dataclasses import replace

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_hil.world.gait import legs_m
from thumper_hil.world.pedestrian import Pedestrian, TimedObstacle
from thumper_hil.world.segment_raycast import polygon_clearance_m
from thumper_hil.world.world import World, box_corners, box_sides

NO_SEGMENTS = np.zeros((0, 4))


class Scene:
    """A world with its timed obstacles and people; `world` is its current state.

    Call `step` as time passes. People without legs stop before they would walk into the robot's footprint;
    `touches_by_people` counts these stops. People with legs walk into it and turn back; the bench judges
    their contacts.
    """

    def __init__(self, world: World) -> None:
        self._fixed = world
        self._people = [_Person(walker) for walker in world.walkers]
        self._present: tuple[TimedObstacle, ...] = ()
        self._posts_m = np.zeros((0, 3))
        self.touches_by_people = 0
        self.world = world
        if self.is_dynamic:
            self._present = _present(world.timed, 0.0)
            self.world = self._compose()

    @property
    def is_dynamic(self) -> bool:
        """True if anything ever appears, disappears or moves."""
        return bool(self._fixed.timed or self._people)

    def set_posts(self, circles_m: FloatArray) -> None:
        """Replace the extra posts by these, shape (n, 3), from now on."""
        self._posts_m = circles_m
        self.world = self._compose()

    def step(self, time_s: float, elapsed_s: float, footprint_m: FloatArray) -> bool:
        """Advance to `time_s` around the robot's footprint, shape (k, 2); return True on a change."""
        if not self.is_dynamic:
            return False
        present = _present(self._fixed.timed, time_s)
        appeared, self._present = present != self._present, present
        moved = [person.step(time_s, elapsed_s, footprint_m) for person in self._people]
        self.touches_by_people += sum(person.has_bumped for person in self._people)
        if appeared or any(moved):
            self.world = self._compose()
            return True
        return False

    def _compose(self) -> World:
        """Return the fixed world with the timed obstacles, posts and people that are there now."""
        boxes = tuple(box_corners(*obstacle.box) for obstacle in self._present if obstacle.box)
        circles = [obstacle.circle for obstacle in self._present if obstacle.circle]
        circles += [
            (*person.position_m, person.walker.radius_m)
            for person in self._people
            if not person.walker.leg_radius_m
        ]
        legs = [person.legs_m() for person in self._people if person.walker.leg_radius_m]
        return replace(
            self._fixed,
            segments_m=np.vstack([self._fixed.segments_m, *(box_sides(box) for box in boxes)]),
            circles_m=np.vstack([self._fixed.circles_m, self._posts_m, np.reshape(circles, (-1, 3))]),
            boxes_m=self._fixed.boxes_m + boxes,
            legs_m=np.vstack([np.zeros((0, 3)), *legs]),
        )


class _Person:
    """A person's position along the waypoints."""

    def __init__(self, walker: Pedestrian) -> None:
        self.walker = walker
        steps_m = np.hypot(*np.diff(walker.waypoints_m, axis=0).T)
        self._along_m = np.concatenate([[0.0], np.cumsum(steps_m)])
        self._walked_m = 0.0  # for the gait
        self._cycle_m = 0.0  # along the waypoints and back
        self._end_m = float(self._along_m[-1])  # of who does not return
        self._is_blocked = False
        self.has_bumped = False
        self.position_m = self._position(0.0)

    def step(self, time_s: float, elapsed_s: float, footprint_m: FloatArray) -> bool:
        """Walk on unless the robot blocks the path; return True if the person moved."""
        self.has_bumped = False
        if time_s < self.walker.from_s:
            return False
        cycle_m = self._cycle_m + self.walker.speed_m_s * elapsed_s
        if not self.walker.returns:
            cycle_m = min(cycle_m, self._end_m)
        if cycle_m == self._cycle_m:
            return False
        position_m = self._position(cycle_m)
        was_blocked = self._is_blocked
        if not self.walker.leg_radius_m:
            self._is_blocked = _touches(footprint_m, np.array([[*position_m, self.walker.radius_m]]))
            self.has_bumped = self._is_blocked and not was_blocked
            if self._is_blocked:
                return False
        self._walked_m += cycle_m - self._cycle_m
        self._cycle_m, self.position_m = cycle_m, position_m
        if self.walker.leg_radius_m:
            self._is_blocked = _touches(footprint_m, self.legs_m())
            if self._is_blocked and not was_blocked:
                self._turn_back()
        return True

    def legs_m(self) -> FloatArray:
        """Return both legs as circles, shape (2, 3)."""
        arrived = not self.walker.returns and self._cycle_m == self._end_m
        here_m = self._position(self._cycle_m - 0.01) if arrived else self.position_m
        ahead_m = self.position_m if arrived else self._position(self._cycle_m + 0.01)
        heading_rad = math.atan2(ahead_m[1] - here_m[1], ahead_m[0] - here_m[0])
        return legs_m(self.position_m, heading_rad, self._walked_m, self.walker.leg_radius_m)

    def _turn_back(self) -> None:
        length_m = float(self._along_m[-1])
        self._cycle_m = 2.0 * length_m - self._cycle_m % (2.0 * length_m)
        self._end_m = length_m if self._cycle_m < length_m else 2.0 * length_m

    def _position(self, cycle_m: float) -> tuple[float, float]:
        length_m = float(self._along_m[-1])
        cycle_m %= 2.0 * length_m
        along_m = min(cycle_m, 2.0 * length_m - cycle_m)
        x_m, y_m = (np.interp(along_m, self._along_m, self.walker.waypoints_m[:, axis]) for axis in (0, 1))
        return float(x_m), float(y_m)


def _touches(footprint_m: FloatArray, circles_m: FloatArray) -> bool:
    return polygon_clearance_m(footprint_m, NO_SEGMENTS, circles_m) <= 0.0


def _present(timed: tuple[TimedObstacle, ...], time_s: float) -> tuple[TimedObstacle, ...]:
    return tuple(obstacle for obstacle in timed if obstacle.from_s <= time_s < obstacle.until_s)
