"""Regulated pure pursuit: an arc to a point ahead on the path, slower in bends and beside obstacles.

Macenski et al., "Regulated Pure Pursuit for Robot Path Tracking" (2023).
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval

from thumper.common.geometry import FloatArray, Twist2, wrap_angle
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.controllers.rotate_in_place import RotateInPlace
from thumper.navigation.controllers.stopping_check import AdmissibilityCheck
from thumper.navigation.footprint import Footprint
from thumper.navigation.planners.polyline import arc_lengths, nearest_index
from thumper.navigation.speed_limits import SpeedLimits, step_toward

SLOWER = (1.0, 0.7, 0.45, 0.25)  # parts of the speed tried until the arc is open


@dataclass(frozen=True, slots=True, kw_only=True)
class PurePursuitOptions:
    """How far ahead it aims and what slows it down."""

    # Distance aimed ahead: this time at the present speed [s] ...
    lookahead_s: Annotated[float, Gt(0)] = 1.2
    # ... but at least [m] ...
    lookahead_min_m: Annotated[float, Gt(0)] = 0.25
    # ... and at most [m]; more is smoother and cuts corners.
    lookahead_max_m: Annotated[float, Gt(0)] = 0.6
    # Bends tighter than this radius are driven slower in proportion [m].
    slow_radius_m: Annotated[float, Gt(0)] = 0.6
    # Nearer to an obstacle than this beyond the inscribed radius it drives slower in proportion [m].
    slow_clearance_m: Annotated[float, Gt(0)] = 0.25
    # Least part of full speed that bends and obstacles leave.
    least_part: Annotated[float, Interval(gt=0, le=1)] = 0.25
    # Direction of the aim off the heading beyond which it turns on the spot first [rad] ...
    turn_start_rad: Annotated[float, Gt(0)] = 0.8
    # ... and below which it drives on [rad].
    turn_end_rad: Annotated[float, Gt(0)] = 0.2


class PurePursuitController:
    """`Controller` by geometry; the arc is driven only while the outline stays free."""

    def __init__(self, options: PurePursuitOptions, limits: SpeedLimits, footprint: Footprint) -> None:
        self._options = options
        self._limits = limits
        self._footprint = footprint
        self._turn = RotateInPlace(limits, footprint)
        self._check = AdmissibilityCheck(limits, footprint)
        self._turning = False

    def reset(self) -> None:
        """Forget that a turn was under way."""
        self._turning = False
        self._turn.reset()

    def turn(self, request: ControlRequest, angle_rad: float) -> ControlResult:
        """Return the next twist of a turn on the spot."""
        return self._turn.command(request, angle_rad)

    def command(self, request: ControlRequest) -> ControlResult:
        """Turn toward the path, or follow an arc to it; None when the arc is not free even slowly."""
        aim_m = self._aim(request)
        angle_rad = math.atan2(aim_m[1], aim_m[0])
        limit_rad = self._options.turn_end_rad if self._turning else self._options.turn_start_rad
        self._turning = abs(angle_rad) > limit_rad and math.hypot(*aim_m) > 0.05
        if self._turning:
            result = self._turn.command(request, wrap_angle(angle_rad))
            if result.command is not None:
                return result
        else:
            self._turn.reset()
        bend = 2.0 * float(aim_m[1]) / max(1e-6, float(aim_m @ aim_m))  # curvature of the arc [1/m]
        wanted_m_s = self._speed(request, bend)
        limits, period_s, last = self._limits, request.period_s, request.last_command
        refused = ""
        for part in SLOWER:
            v_m_s = step_toward(last.v_m_s, part * wanted_m_s, limits.v_accel_m_s2 * period_s)
            w_rad_s = min(max(v_m_s * bend, -limits.w_max_rad_s), limits.w_max_rad_s)
            w_rad_s = step_toward(last.w_rad_s, w_rad_s, limits.w_accel_rad_s2 * period_s)
            command = Twist2(v_m_s=v_m_s, w_rad_s=w_rad_s)
            refused, trajectory = self._check.refusal(request, command)
            if not refused:
                return ControlResult(command=command, trajectory=trajectory)
        return ControlResult(command=None, reason=f"the arc to the path {refused}")

    def _aim(self, request: ControlRequest) -> FloatArray:
        """The point to drive at, in base_link, shape (2,) [m]."""
        options, base = self._options, request.map_from_base
        rest_m = request.path_m[nearest_index(request.path_m, base.x_m, base.y_m) :]
        reach_m = abs(request.twist.v_m_s) * options.lookahead_s
        reach_m = min(max(reach_m, options.lookahead_min_m), options.lookahead_max_m)
        index = min(int(np.searchsorted(arc_lengths(rest_m), reach_m)), len(rest_m) - 1)
        point_m: FloatArray = base.inverse().apply(rest_m[index : index + 1])[0]
        return point_m

    def _speed(self, request: ControlRequest, bend: float) -> float:
        options = self._options
        part = min(1.0, 1.0 / max(1e-6, abs(bend) * options.slow_radius_m))
        part = min(part, max(0.0, _clearance_m(request, self._footprint)) / options.slow_clearance_m)
        return request.v_limit_m_s * min(1.0, max(options.least_part, part))


def _clearance_m(request: ControlRequest, footprint: Footprint) -> float:
    """Distance of the nearest obstacle cell from the inscribed circle [m]; large when far."""
    costmap, base = request.costmap, request.map_from_base
    rows, cols = costmap.cells_of(np.array(((base.x_m, base.y_m),)))
    row, col = int(rows[0]), int(cols[0])
    if not (0 <= row < costmap.costs.shape[0] and 0 <= col < costmap.costs.shape[1]):
        return 0.0
    far_m = math.sqrt(float(costmap.squared_cells[row, col])) * costmap.resolution_m
    return far_m - footprint.inscribed_radius_m
