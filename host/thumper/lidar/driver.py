"""The interface of all lidar drivers."""

from dataclasses import dataclass
from typing import TypeAlias

from thumper.common.sensor import Sensor, SensorCounters
from thumper.lidar.scan import Scan

LidarDriver: TypeAlias = Sensor[Scan]
"""A streaming lidar. The constructor starts it; `poll` never waits and never raises."""


@dataclass(slots=True, kw_only=True)
class LidarCounters(SensorCounters):
    """Events on the line of a lidar that numbers its points."""

    lost_points: int = 0  # missing between two packets
