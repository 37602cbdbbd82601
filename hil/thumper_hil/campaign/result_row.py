"""The result of one drive of a campaign: a row of rows.csv."""

import math
from dataclasses import dataclass, field, fields
from typing import Any


def _measure(title: str) -> Any:
    """Declare a measure that the summary can average; NaN if the drive ended before it existed."""
    return field(default=math.nan, metadata={"title": title})


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignRow:
    """One drive. All errors are relative to ground truth."""

    key: str
    mission: str
    parameters: str
    seed: int
    reached: bool
    contacts: int = 0  # of the robot with an obstacle or a person
    touches_by_people: int = 0  # a person walked into the robot
    goal_error_m: float = _measure("goal error [m]")
    time_s: float = _measure("time [s]")
    path_length_m: float = _measure("path length [m]")
    pose_rmse_m: float = _measure("SLAM pose error, rms [m]")  # over the whole drive
    pose_max_m: float = _measure("SLAM pose error, worst [m]")
    odometry_error_m: float = _measure("odometry error at the end [m]")  # dead reckoning
    odometry_error_rad: float = _measure("odometry error at the end [rad]")
    speed_error_mean_rad_s: float = _measure("wheel speed error, mean [rad/s]")  # while moving, worse side
    speed_error_std_rad_s: float = _measure("wheel speed error, std [rad/s]")
    reason: str


MEASURES: dict[str, str] = {
    one.name: one.metadata["title"] for one in fields(CampaignRow) if "title" in one.metadata
}
"""The measures of a row and their titles."""


def succeeded(row: CampaignRow) -> bool:
    """Return True if the drive reached its goal without a contact."""
    return row.reached and row.contacts == 0
