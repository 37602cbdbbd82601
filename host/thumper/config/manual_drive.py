"""Options of manual driving: the `[service]` table of the robot's TOML."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le


@dataclass(frozen=True, slots=True, kw_only=True)
class ManualDriveOptions:
    """How long each source of commands is valid, and the speed limits of manual driving."""

    # A client that drives or has sent a goal must send a heartbeat within this time [s].
    heartbeat_timeout_s: Annotated[float, Gt(0), Le(0.35)] = 0.3
    # A gamepad command is valid for this time [s].
    gamepad_timeout_s: Annotated[float, Ge(0.1), Le(0.5)] = 0.3
    # A command of the page's stick or the keyboard is valid for this time [s].
    teleop_timeout_s: Annotated[float, Ge(0.1), Le(0.5)] = 0.3
    # Speed limit of manual driving [m/s].
    manual_v_max_m_s: Annotated[float, Gt(0), Le(1.0)] = 0.8
    # Turning speed limit of manual driving [rad/s].
    manual_w_max_rad_s: Annotated[float, Gt(0), Le(6.0)] = 2.5
