"""Options of the GPS receiver: the `[gps]` table of the robot's TOML."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt

from thumper.common.geometry import Pose2


@dataclass(frozen=True, slots=True, kw_only=True)
class GpsOptions:
    """Options of the GPS receiver, which sends NMEA 0183 or UBX."""

    enabled: bool = False  # read the GPS receiver
    port: str = "/dev/ttyACM0"  # serial device or sim://NAME/gps
    baud: Annotated[int, Gt(0)] = 38_400  # ZED-F9P, NEO-M9N: 38400; NEO-M8: 9600; without effect over USB
    x_m: float = 0.0  # antenna in the robot's frame, forward
    y_m: float = 0.0  # to the left
    latency_s: Annotated[float, Ge(0)] = 0.15  # from the measurement until it is read

    @property
    def base_from_antenna(self) -> Pose2:
        """Mounting pose of the antenna."""
        return Pose2(x_m=self.x_m, y_m=self.y_m)
