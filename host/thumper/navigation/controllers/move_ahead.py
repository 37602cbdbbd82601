"""Drive straight ahead until the lidar has seen the ground that the tail will sweep.

A robot that has just started has never seen what is beside and behind its tail. It can neither turn nor
follow a bend there. Straight ahead it moves over ground that it sees.
"""

from thumper.common.geometry import Twist2
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.controllers.rotate_in_place import poses_are_free, straight_poses
from thumper.navigation.footprint import Footprint
from thumper.navigation.speed_limits import SpeedLimits, step_toward

SPEED_M_S = 0.2
STOPPING_M = 0.10  # from that speed


class MoveAhead:
    """Moves ahead while unseen ground is beside the robot."""

    def __init__(self, limits: SpeedLimits, footprint: Footprint) -> None:
        self._limits = limits
        self._footprint = footprint

    def compute_command(self, request: ControlRequest) -> ControlResult | None:
        """Return the next twist; None if the robot may turn here, or the straight way is not free."""
        if request.move_ahead_m == 0.0:
            return None
        base, last, limits = request.map_from_base, request.last_command, self._limits
        poses = straight_poses(base, request.move_ahead_m + STOPPING_M)
        costmap = request.pose_costmap or request.costmap
        if not poses_are_free(costmap, self._footprint, poses, base, unknown_blocks=False):
            return None
        speed_m_s = min(SPEED_M_S, request.v_limit_m_s)
        command = Twist2(
            v_m_s=step_toward(last.v_m_s, speed_m_s, limits.v_accel_m_s2 * request.period_s),
            w_rad_s=step_toward(last.w_rad_s, 0.0, limits.w_accel_rad_s2 * request.period_s),
        )
        return ControlResult(command=command, trajectory=poses)
