"""The local frame: where remembered points are, relative to the robot. Pure.

The pose in the map is right in the long run, but it jitters by centimetres from scan to scan, and by a
decimetre when somebody stands close. Odometry does not jitter, but it drifts as the robot moves. So the local
frame follows odometry, and takes over the correction by the map little by little, while the robot moves: a
complementary filter (Mahony et al., 2008). Without motion, nothing moves.
"""

import math

from thumper.common.geometry import Pose2

# The correction is taken over along this way, or with this turn.
BLEND_M, BLEND_RAD = 0.5, 1.0
# If more than this is left, the robot's wheels slip: as much more is taken over as the robot has moved by
# odometry. What is left even then is not by the wheels: the surroundings have moved with the map.
MAX_ERROR_M, MAX_ERROR_RAD = 0.06, 0.06
# The map has jumped if it corrects the pose in one cycle by more than this and more than the robot has moved.
# Then the surroundings have jumped with it.
JUMP_M, JUMP_RAD = 0.05, 0.05


class LocalFrame:
    """Follows the robot, and says where the local frame is in the map."""

    def __init__(self) -> None:
        self._last: tuple[Pose2, Pose2] | None = None  # map_from_base and map_from_odom
        self._error = Pose2()  # from the pose in the local frame to the corrected one, in base_link

    def update(self, map_from_base: Pose2, map_from_odom: Pose2) -> Pose2:
        """Take a cycle's pose; return `new_from_old`, by which all that is remembered moves in the map."""
        last, self._last = self._last, (map_from_base, map_from_odom)
        if last is None:
            return Pose2()
        last_from_base, last_from_odom = last
        last_on_map = map_from_odom @ last_from_odom.inverse() @ last_from_base
        moved = last_on_map.inverse() @ map_from_base  # by odometry
        by_odometry = last_from_base @ moved
        correction = by_odometry.inverse() @ map_from_base
        moved_m, moved_rad = _size(moved)
        correction_m, correction_rad = _size(last_from_base.inverse() @ last_on_map)
        error = moved.inverse() @ self._error @ moved
        if correction_m <= JUMP_M + moved_m and correction_rad <= JUMP_RAD + moved_rad:
            error @= correction
        fraction = min(1.0, moved_m / BLEND_M + moved_rad / BLEND_RAD)
        error_m, error_rad = _size(error)
        taken_m = max(fraction * error_m, min(error_m - MAX_ERROR_M, moved_m))
        taken_rad = max(fraction * error_rad, min(error_rad - MAX_ERROR_RAD, moved_rad))
        taken = _shortened(error, taken_m, taken_rad)
        self._error = _shortened(taken.inverse() @ error, MAX_ERROR_M, MAX_ERROR_RAD)
        return map_from_base @ (by_odometry @ taken).inverse()


def _size(moved: Pose2) -> tuple[float, float]:
    """Return the way [m] and the turn [rad]."""
    return math.hypot(moved.x_m, moved.y_m), abs(moved.theta_rad)


def _shortened(moved: Pose2, limit_m: float, limit_rad: float) -> Pose2:
    """Return a motion with no longer way and no wider turn than these."""
    moved_m, moved_rad = _size(moved)
    along, turned = min(1.0, limit_m / max(moved_m, 1e-9)), min(1.0, limit_rad / max(moved_rad, 1e-9))
    return Pose2(x_m=along * moved.x_m, y_m=along * moved.y_m, theta_rad=turned * moved.theta_rad)
