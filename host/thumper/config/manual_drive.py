"""Options of the robot's process: the `[service]` table of the robot's TOML."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le


@dataclass(frozen=True, slots=True, kw_only=True)
class ManualDriveOptions:
    """How long each source of commands is believed, and how fast it may be driven by hand."""

    # A page that drives or has sent a goal must be heard of this often [s].
    heartbeat_timeout_s: Annotated[float, Gt(0), Le(0.35)] = 0.3
    # A gamepad's command holds this long [s].
    gamepad_timeout_s: Annotated[float, Ge(0.1), Le(0.5)] = 0.3
    # A command of the page's stick or of the keyboard holds this long [s].
    teleop_timeout_s: Annotated[float, Ge(0.1), Le(0.5)] = 0.3
    # Fastest speed by hand [m/s].
    manual_v_max_m_s: Annotated[float, Gt(0), Le(1.0)] = 0.8
    # Fastest turn by hand [rad/s].
    manual_w_max_rad_s: Annotated[float, Gt(0), Le(6.0)] = 2.5
