"""Options of the camera: the `[camera]` table of the robot's TOML."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le

from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.common.geometry import FloatArray

DISTORTION_NUMBERS = 5  # of ROS's model plumb_bob


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraOptions:
    """Port, image, intrinsics and mounting pose of the camera; the intrinsics are those of OpenCV."""

    enabled: bool = False  # read the camera
    port: str = "/dev/video0"  # V4L2 device or sim://NAME/camera
    width_px: Annotated[int, Gt(0)] = 640  # columns of the image
    height_px: Annotated[int, Gt(0)] = 480  # rows
    rate_Hz: Annotated[float, Gt(0)] = 10.0  # frames per second asked of the camera
    fx_px: Annotated[float, Gt(0)] = 600.0  # focal length in pixels, along the rows
    fy_px: Annotated[float, Gt(0)] = 600.0  # along the columns
    cx_px: float = 319.5  # column of the principal point; the centre of the top left pixel is 0, 0
    cy_px: float = 239.5  # row of the principal point
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)  # 5 numbers: k1, k2, p1, p2, k3
    x_m: float = 0.15  # lens in the robot's frame, forward
    y_m: float = 0.0  # to the left
    z_m: float = 0.20  # above the floor
    yaw_deg: Annotated[float, Ge(-180), Le(180)] = 0.0  # counter-clockwise; 0: forward
    pitch_deg: Annotated[float, Gt(-90), Le(90)] = 0.0  # downward
    latency_s: Annotated[float, Ge(0)] = 0.03  # from the middle of the exposure to the driver's stamp
    publish_Hz: Annotated[float, Gt(0)] = 2.0  # at most so many frames are published and recorded
    detector: str = ""  # ONNX file of a YOLO detector, which finds objects; empty: none
    min_score: Annotated[float, Gt(0), Le(1)] = 0.5  # of a detected object

    def __post_init__(self) -> None:
        if self.detector and not self.enabled:
            raise ValueError("detector needs enabled = true")
        if len(self.distortion) != DISTORTION_NUMBERS:
            raise ValueError(
                f"distortion needs {DISTORTION_NUMBERS} numbers, k1, k2, p1, p2, k3; "
                f"{len(self.distortion)} are given"
            )

    def check_shape(self, shape: tuple[int, int]) -> None:
        """Raise ThumperError if frames have another height and width: the intrinsics are not for them."""
        if shape != (self.height_px, self.width_px):
            raise ThumperError(
                f"the camera {self.port} sends {shape[1]} x {shape[0]} pixels; correct [camera] width_px and "
                "height_px, and the intrinsics with them",
                exit_code=EXIT_NOT_THERE,
            )

    def matrix(self) -> FloatArray:
        """Return the camera matrix, shape (3, 3)."""
        return np.array(
            [[self.fx_px, 0.0, self.cx_px], [0.0, self.fy_px, self.cy_px], [0.0, 0.0, 1.0]], dtype=np.float64
        )

    def base_from_optical(self) -> FloatArray:
        """Return the mounting pose, shape (4, 4), of the optical frame: x right, y down, z forward."""
        yaw_rad, pitch_rad = math.radians(self.yaw_deg), math.radians(self.pitch_deg)
        (cy, sy), (cp, sp) = ((math.cos(angle), math.sin(angle)) for angle in (yaw_rad, pitch_rad))
        forward, left, up = (cy * cp, sy * cp, -sp), (-sy, cy, 0.0), (cy * sp, sy * sp, cp)
        mounted = np.eye(4)
        mounted[:3, 0], mounted[:3, 1] = -np.array(left), -np.array(up)
        mounted[:3, 2], mounted[:3, 3] = forward, (self.x_m, self.y_m, self.z_m)
        return mounted
