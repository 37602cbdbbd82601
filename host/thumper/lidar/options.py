"""Options of the lidar: the `[lidar]` table of the robot's TOML."""

import math
from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Ge, Le

from thumper.common.geometry import Pose2
from thumper.lidar.a5_lidar import RplidarOptions
from thumper.lidar.a5_models import A5_MODELS
from thumper.lidar.field_of_view import FieldOfView
from thumper.lidar.ld19 import Ld19Options
from thumper.lidar.urg04lx import Urg04LxOptions

LidarModel = Literal["urg04lx", "ld19", "rplidar_a1", "rplidar_a2", "rplidar_c1", "ydlidar_x4"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LidarOptions:
    """Model, port and mounting pose of the lidar (base_link: between the middle wheels)."""

    model: LidarModel = "urg04lx"  # selects driver and field of view
    port: str = "/dev/ttyACM0"  # serial device or sim://NAME/lidar
    baud: Annotated[int, Ge(0)] = 0  # 0: the model's default; USB lidars ignore it
    x_m: float = 0.12  # mounting position in base_link, forward
    y_m: float = 0.0  # mounting position in base_link, to the left
    yaw_deg: Annotated[float, Ge(-180), Le(180)] = 0.0  # mounting angle, counter-clockwise; 0: forward
    upside_down: bool = False  # mounted the other way up: left and right are exchanged
    urg04lx: Urg04LxOptions = field(default_factory=Urg04LxOptions)
    ld19: Ld19Options = field(default_factory=Ld19Options)
    rplidar: RplidarOptions = field(default_factory=RplidarOptions)  # also of ydlidar_x4

    @property
    def base_from_laser(self) -> Pose2:
        """Mounting pose as a transform."""
        return Pose2(x_m=self.x_m, y_m=self.y_m, theta_rad=math.radians(self.yaw_deg))

    @property
    def view(self) -> FieldOfView:
        """Field of view, from the model's data sheet."""
        opening_deg, range_m = {"urg04lx": (240.0, 4.0), "ld19": (360.0, 12.0)}.get(self.model) or (
            360.0,
            A5_MODELS[self.model].range_max_m,
        )
        return FieldOfView(
            base_from_laser=self.base_from_laser, opening_rad=math.radians(opening_deg), range_m=range_m
        )
