"""Options of manual driving: the `[service]` table of the robot's TOML."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Gt, Le

from thumper.common.geometry import Twist2


@dataclass(frozen=True, slots=True, kw_only=True)
class ManualDriveOptions:
    """Limits of manual driving."""

    # Whether manual commands are slowed and stopped before obstacles, unless the operator overrides it.
    assisted: bool = True

    # Speed limit of manual driving [m/s].
    manual_v_max_m_s: Annotated[float, Gt(0), Le(1.0)] = 0.8
    # Turning speed limit of manual driving [rad/s].
    manual_w_max_rad_s: Annotated[float, Gt(0), Le(6.0)] = 2.5

    def limit(self, twist: Twist2) -> Twist2:
        """Return the twist, scaled down to the limits; the curvature stays the same."""
        scale = min(
            1.0,
            self.manual_v_max_m_s / max(abs(twist.v_m_s), 1e-9),
            self.manual_w_max_rad_s / max(abs(twist.w_rad_s), 1e-9),
        )
        return Twist2(v_m_s=scale * twist.v_m_s, w_rad_s=scale * twist.w_rad_s)
