"""Two controllers in one: the trajectory tracker while the path is free, the configured one elsewhere."""

import math

import numpy as np

from thumper.navigation.cascade import CascadeController, CascadeOptions
from thumper.navigation.controller import Controller, ControlRequest, ControlResult
from thumper.navigation.footprint import Footprint
from thumper.navigation.path import arc_lengths, nearest_index


class FreeWayController:
    """`Controller` that looks at the room along the path and hands over."""

    def __init__(
        self, tracker: CascadeController, other: Controller, options: CascadeOptions, footprint: Footprint
    ) -> None:
        self._tracker = tracker
        self._other = other
        self._ahead_m = options.free_ahead_m
        self._room_m = footprint.circumscribed_radius_m + options.free_room_m
        self._tracking = False

    def reset(self) -> None:
        """Forget the past in both."""
        self._tracker.reset()
        self._other.reset()

    def turn(self, request: ControlRequest, angle_rad: float) -> ControlResult:
        """Return the next twist of a turn on the spot."""
        return self._other.turn(request, angle_rad)

    def command(self, request: ControlRequest) -> ControlResult:
        """Return what the controller in charge says; a tracker that finds no way hands over."""
        free = self._is_free(request)
        if free != self._tracking:
            (self._tracker if free else self._other).reset()
            self._tracking = free
        if free:
            result = self._tracker.command(request)
            if result.command is not None:
                return result
        return self._other.command(request)

    def _is_free(self, request: ControlRequest) -> bool:
        """Whether the robot, and the path ahead, have room for its circle and some more."""
        base, costmap = request.map_from_base, request.costmap
        rest_m = request.path_m[nearest_index(request.path_m, base.x_m, base.y_m) :]
        ahead_m = rest_m[arc_lengths(rest_m) <= self._ahead_m]
        rows, cols = costmap.cells_of(np.vstack(((base.x_m, base.y_m), ahead_m)))
        inside = (rows >= 0) & (cols >= 0) & (rows < costmap.costs.shape[0]) & (cols < costmap.costs.shape[1])
        if not inside.all():
            return False
        least_cells = math.sqrt(float(costmap.squared_cells[rows, cols].min()))
        return least_cells * costmap.resolution_m >= self._room_m
