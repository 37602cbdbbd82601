"""Trajectory Rollout: as the dynamic window, but with every speed that can be reached within the horizon.

Gerkey & Konolige, "Planning and Control in Unstructured Terrain" (2008). It sees further than the dynamic
window, whose commands all lie within one period, and reacts a little less finely.
"""

import numpy as np

from thumper.geometry import FloatArray, Twist2
from thumper.navigation.controller import ControlRequest
from thumper.navigation.dwa import DwaController
from thumper.navigation.limits import step_toward


class TrajectoryRolloutController(DwaController):
    """`Controller` by rolling out the speeds of the whole horizon; takes the options of the dynamic
    window.
    """

    def _window(self, request: ControlRequest) -> FloatArray:
        limits, last, horizon_s = self._limits, request.last_command, self._options.horizon_s
        reach = limits.v_accel_m_s2 * horizon_s
        v_high = min(request.v_limit_m_s, max(0.0, last.v_m_s) + reach)
        v = np.linspace(min(v_high, max(0.0, last.v_m_s - reach)), v_high, self._options.v_samples)
        turn = limits.w_accel_rad_s2 * horizon_s
        w_low, w_high = (
            max(-limits.w_max_rad_s, last.w_rad_s - turn),
            min(limits.w_max_rad_s, last.w_rad_s + turn),
        )
        w = np.linspace(w_low, w_high, self._options.w_samples)
        w[np.argmin(np.abs(w))] = min(max(0.0, w_low), w_high)
        v_grid, w_grid = np.meshgrid(v, w, indexing="ij")
        return np.column_stack((v_grid.ravel(), w_grid.ravel()))

    def _first_step(self, request: ControlRequest, chosen: FloatArray) -> Twist2:
        """The speeds on the way to the chosen ones that can be had in one period."""
        limits, last = self._limits, request.last_command
        return Twist2(
            v_m_s=step_toward(last.v_m_s, float(chosen[0]), limits.v_accel_m_s2 * request.period_s),
            w_rad_s=step_toward(last.w_rad_s, float(chosen[1]), limits.w_accel_rad_s2 * request.period_s),
        )
