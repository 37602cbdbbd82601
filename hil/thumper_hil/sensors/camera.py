"""Simulate a USB camera: renders the world, blurs it by motion, adds noise, compresses to JPEG.

It has a global shutter, 640 x 480 pixels and a lens of 56 degrees without distortion. It sends
multipart/x-mixed-replace as mjpg-streamer does, and stamps each image as a V4L2 driver does, at the end of
the frame. Its intrinsics and mounting differ from the nominal ones by what a calibration leaves.
"""

import math
from collections.abc import Callable

import cv2
import numpy as np

from thumper.camera.options import CameraOptions
from thumper.common.geometry import FloatArray, Pose2
from thumper_hil.lidars.outbox import Outbox
from thumper_hil.sensors.camera_view import CameraView, GreyImage
from thumper_hil.world.world import World

PERIOD_S, EXPOSURE_S = 0.1, 0.016
STAMP_S, STAMP_SPREAD_S = 0.03, 0.004  # from the middle of the exposure, and from unit to unit
TRANSFER_S = 0.025  # after the stamp
NOISE_STD, JPEG_QUALITY = 2.5, 85
BLUR_STEPS, SHARP_M, SHARP_RAD = 5, 2e-4, 3e-4  # motion within an exposure that blurs nothing
FOCAL_STD, CENTRE_STD_PX = 0.002, 1.0  # left by a calibration
OFFSET_STD_M, YAW_STD_DEG, PITCH_STD_DEG = 0.001, 0.15, 0.3  # left by a ruler and a level


class Camera:
    """The device. The caller owns the clock: call `advance`, then `read` the bytes that have arrived.

    `pose_at(times_s)` returns the robot's pose, shape (n, 3), at times up to an exposure back.
    """

    baud = 0  # USB: any

    def __init__(
        self,
        *,
        pose_at: Callable[[FloatArray], FloatArray],
        world: Callable[[], World],
        seed: int,
        power_on_s: float = 0.0,
    ) -> None:
        self._rng = np.random.default_rng([seed, 0xCA3])
        self._pose_at, self._world = pose_at, world
        self._stamp_s = STAMP_S + STAMP_SPREAD_S * float(self._rng.uniform(-1.0, 1.0))
        self._view = self._true_view()
        self._frame = math.ceil(power_on_s / PERIOD_S)
        self._outbox = Outbox()
        self._now_s = power_on_s

    def write(self, data: bytes, time_s: float) -> None:
        """Ignore bytes from the host."""

    def advance(self, time_s: float) -> None:
        """Advance time and send the frames that are exposed by then."""
        while self._frame * PERIOD_S + EXPOSURE_S <= time_s:
            self._expose(self._frame * PERIOD_S)
            self._frame += 1
        self._now_s = max(self._now_s, time_s)

    def read(self) -> bytes:
        """Return the bytes that have reached the host."""
        return self._outbox.arrived(self._now_s)

    def _true_view(self) -> CameraView:
        focal, *centre = self._rng.standard_normal(3)
        x, y, z, yaw, pitch = self._rng.standard_normal(5)
        nominal = CameraOptions()
        true = CameraOptions(
            fx_px=nominal.fx_px * (1.0 + FOCAL_STD * focal),
            fy_px=nominal.fy_px * (1.0 + FOCAL_STD * focal),
            cx_px=nominal.cx_px + CENTRE_STD_PX * centre[0],
            cy_px=nominal.cy_px + CENTRE_STD_PX * centre[1],
            x_m=nominal.x_m + OFFSET_STD_M * x,
            y_m=nominal.y_m + OFFSET_STD_M * y,
            z_m=nominal.z_m + OFFSET_STD_M * z,
            yaw_deg=YAW_STD_DEG * yaw,
            pitch_deg=PITCH_STD_DEG * pitch,
        )
        return CameraView((true.width_px, true.height_px), true.matrix(), true.base_from_optical())

    def _expose(self, start_s: float) -> None:
        grey = self._blurred(start_s)
        noise = cv2.randn(np.empty_like(grey), 0.0, NOISE_STD)  # type: ignore[call-overload]
        pixels = np.clip(grey + noise, 0.0, 255.0).astype(np.uint8)
        jpeg = cv2.imencode(".jpg", pixels, (cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY))[1].tobytes()
        stamp_s = start_s + 0.5 * EXPOSURE_S + self._stamp_s
        head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n"
        head += f"X-Timestamp: {stamp_s:.6f}\r\n\r\n"
        self._outbox.send(head.encode() + jpeg + b"\r\n", stamp_s + TRANSFER_S)

    def _blurred(self, start_s: float) -> GreyImage:
        """Average images along the motion during the exposure."""
        times_s = start_s + EXPOSURE_S * (np.arange(BLUR_STEPS) + 0.5) / BLUR_STEPS
        poses = [Pose2(x_m=x, y_m=y, theta_rad=yaw) for x, y, yaw in self._pose_at(times_s).tolist()]
        moved = poses[0].inverse() @ poses[-1]
        if math.hypot(moved.x_m, moved.y_m) < SHARP_M and abs(moved.theta_rad) < SHARP_RAD:
            poses = poses[BLUR_STEPS // 2 : BLUR_STEPS // 2 + 1]
        world = self._world()
        images = [self._view.render(world, pose) for pose in poses]
        return np.asarray(np.mean(images, axis=0), np.float32) if len(images) > 1 else images[0]
