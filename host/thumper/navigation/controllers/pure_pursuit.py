"""Regulated pure pursuit: an arc to a point ahead on the path, slower in bends and near obstacles.

Macenski et al., "Regulated Pure Pursuit for Robot Path Tracking" (2023).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval

from thumper.common.geometry import FloatArray, Twist2, wrap_angle
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.controllers.rotate_in_place import SHORTEST_PATH_M, RotateInPlaceOptions, RotationShim
from thumper.navigation.controllers.stopping_check import AdmissibilityCheck
from thumper.navigation.footprint import Footprint
from thumper.navigation.planners.polyline import ahead
from thumper.navigation.speed_limits import SpeedLimits, step_toward

SPEED_FRACTIONS = (1.0, 0.7, 0.45, 0.25)  # tried until the arc is free
# The angle is that of the lookahead point, further ahead than the other controllers look, and so smaller.
ROTATION = RotateInPlaceOptions(turn_start_rad=0.8, turn_end_rad=0.2)


@dataclass(frozen=True, slots=True, kw_only=True)
class PurePursuitOptions:
    """The lookahead distance, and what slows the robot down."""

    # Lookahead distance as driving time at the present speed [s] ...
    lookahead_s: Annotated[float, Gt(0)] = 1.2
    # ... but at least [m] ...
    lookahead_min_m: Annotated[float, Gt(0)] = 0.25
    # ... and at most [m]; more is smoother and cuts corners.
    lookahead_max_m: Annotated[float, Gt(0)] = 0.6
    # Bends of a smaller radius are driven proportionally slower [m].
    slow_radius_m: Annotated[float, Gt(0)] = 0.6
    # Clearance beyond the inscribed radius below which the robot drives proportionally slower [m].
    slow_clearance_m: Annotated[float, Gt(0)] = 0.25
    # Least fraction of the speed that bends and obstacles leave.
    least_part: Annotated[float, Interval(gt=0, le=1)] = 0.25


class PurePursuitController:
    """`Controller` by geometry; drives the arc only while the outline is free."""

    def __init__(self, options: PurePursuitOptions, limits: SpeedLimits, footprint: Footprint) -> None:
        self._options = options
        self._limits = limits
        self._footprint = footprint
        self._rotation = RotationShim(ROTATION, limits, footprint)
        self._check = AdmissibilityCheck(limits, footprint)

    def reset(self) -> None:
        """Forget that a rotation was under way."""
        self._rotation.reset()

    def rotate(self, request: ControlRequest, angle_rad: float) -> ControlResult:
        """Return the next twist of a rotation in place."""
        return self._rotation.rotate(request, angle_rad)

    def compute_command(self, request: ControlRequest) -> ControlResult:
        """Rotate toward the path, or drive an arc to it; None if the arc is not free even at low speed."""
        target_m = self._lookahead_point(request)
        angle_rad = wrap_angle(math.atan2(target_m[1], target_m[0]))
        enabled = math.hypot(*target_m) > SHORTEST_PATH_M
        rotation = self._rotation.toward(request, angle_rad, enabled=enabled)
        if rotation is not None:
            return rotation
        curvature = 2.0 * float(target_m[1]) / max(1e-6, float(target_m @ target_m))  # of the arc [1/m]
        candidates = self._candidates(request, curvature)
        return self._check.first_admissible(request, candidates, "the arc to the path")

    def _candidates(self, request: ControlRequest, curvature: float) -> Iterator[Twist2]:
        """Yield commands along the arc, from the regulated speed down."""
        limits, period_s, last = self._limits, request.period_s, request.last_command
        wanted_m_s = self._regulated_speed(request, curvature)
        for fraction in SPEED_FRACTIONS:
            v_m_s = step_toward(last.v_m_s, fraction * wanted_m_s, limits.v_accel_m_s2 * period_s)
            w_rad_s = min(max(v_m_s * curvature, -limits.w_max_rad_s), limits.w_max_rad_s)
            w_rad_s = step_toward(last.w_rad_s, w_rad_s, limits.w_accel_rad_s2 * period_s)
            yield Twist2(v_m_s=v_m_s, w_rad_s=w_rad_s)

    def _lookahead_point(self, request: ControlRequest) -> FloatArray:
        """Return the lookahead point in base_link, shape (2,) [m]."""
        options, base = self._options, request.map_from_base
        distance_m = abs(request.twist.v_m_s) * options.lookahead_s
        distance_m = min(max(distance_m, options.lookahead_min_m), options.lookahead_max_m)
        point_m: FloatArray = base.inverse().apply(ahead(request.path_m, base, distance_m)[-1:])[0]
        return point_m

    def _regulated_speed(self, request: ControlRequest, curvature: float) -> float:
        options = self._options
        fraction = min(1.0, 1.0 / max(1e-6, abs(curvature) * options.slow_radius_m))
        clearance_m = max(0.0, _clearance_m(request, self._footprint))
        fraction = min(fraction, clearance_m / options.slow_clearance_m)
        return request.v_limit_m_s * min(1.0, max(options.least_part, fraction))


def _clearance_m(request: ControlRequest, footprint: Footprint) -> float:
    """Return the distance from the inscribed circle to the nearest obstacle cell [m], capped."""
    costmap, base = request.costmap, request.map_from_base
    rows, cols = costmap.cells_of(np.array(((base.x_m, base.y_m),)))
    row, col = int(rows[0]), int(cols[0])
    if not (0 <= row < costmap.costs.shape[0] and 0 <= col < costmap.costs.shape[1]):
        return 0.0
    distance_m = math.sqrt(float(costmap.squared_cells[row, col])) * costmap.resolution_m
    return distance_m - footprint.inscribed_radius_m
