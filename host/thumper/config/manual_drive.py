"""Options of manual driving: the `[service]` table of the robot's TOML."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Gt, Le


@dataclass(frozen=True, slots=True, kw_only=True)
class ManualDriveOptions:
    """Limits of manual driving."""

    # Whether manual commands are slowed and stopped before obstacles, unless the operator overrides it.
    assisted: bool = True

    # Speed limit of manual driving [m/s].
    manual_v_max_m_s: Annotated[float, Gt(0), Le(1.0)] = 0.8
    # Turning speed limit of manual driving [rad/s].
    manual_w_max_rad_s: Annotated[float, Gt(0), Le(6.0)] = 2.5
