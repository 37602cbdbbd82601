"""What a drive of a campaign came to: a line of rows.csv."""

import math
from dataclasses import dataclass, field, fields
from typing import Any


def _measure(title: str) -> Any:
    """A figure that a mean says something of; NaN where the drive never got that far."""
    return field(default=math.nan, metadata={"title": title})


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignRow:
    """One drive. Errors are against ground truth."""

    key: str
    mission: str
    parameters: str
    seed: int
    reached: bool
    contacts: int = 0
    goal_error_m: float = _measure("goal error [m]")
    time_s: float = _measure("time [s]")
    path_length_m: float = _measure("way [m]")
    pose_rmse_m: float = _measure("SLAM pose error, rms [m]")  # of its own estimate, all along
    pose_max_m: float = _measure("SLAM pose error, worst [m]")
    odometry_error_m: float = _measure("odometry error at the end [m]")  # dead reckoning
    odometry_error_rad: float = _measure("odometry error at the end [rad]")
    speed_error_mean_rad_s: float = _measure("wheel speed error, mean [rad/s]")  # moving, the worse side
    speed_error_std_rad_s: float = _measure("wheel speed error, std [rad/s]")
    reason: str


MEASURES: dict[str, str] = {
    one.name: one.metadata["title"] for one in fields(CampaignRow) if "title" in one.metadata
}
"""The figures of a row and their titles."""


def succeeded(row: CampaignRow) -> bool:
    """Goal reached, nothing touched."""
    return row.reached and row.contacts == 0
