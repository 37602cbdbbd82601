"""The pose of one upright tag, fitted to its corners in the newest frames, in the frame of the odometry.

One frame that shows a tag head-on fits two mirrored directions alike. The sum over frames does not, and it
averages the noise before the direction follows from it. Within a frame the shape of the square is sharp to a
fraction of a pixel; its place also moves with the heading of the odometry and with the body's pitch. So both
count with their own noise.
"""

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from thumper.camera.frame import CameraFrame
from thumper.camera.options import CameraOptions
from thumper.camera.tags import planar_pose, tag_poses, tags_in, undistorted
from thumper.common.geometry import FloatArray, Pose2

SHAPE_PX, COLUMN_PX, ROW_PX = 0.15, 1.0, 3.0  # noise of a corner, and of the place of the whole square
FADING_S = 1.0  # after which a frame counts 1/e: the odometry of a skid-steered robot drifts as it turns
MAX_FRAMES = 20
ITERATIONS, STEP = 6, 1e-5


class _Seen(NamedTuple):
    """A frame that shows the tag."""

    time_s: float
    odom_from_base: Pose2
    corners: FloatArray  # undistorted, in units of the focal length, shape (4, 2)


class TagTracker:
    """Call `add` with each frame."""

    def __init__(self, tag: int, size_m: float, camera: CameraOptions) -> None:
        self._tag, self._size_m, self._camera = tag, size_m, camera
        self._optical_from_base = np.linalg.inv(camera.base_from_optical())
        self._seen: deque[_Seen] = deque(maxlen=MAX_FRAMES)
        self._fit: FloatArray | None = None  # x, y, z, theta
        self.count = 0  # frames that showed the tag

    def forget(self) -> None:
        """Start again."""
        self._seen.clear()
        self._fit, self.count = None, 0

    def add(self, frame: CameraFrame, odom_from_base: Pose2) -> None:
        """Add a frame taken at a pose."""
        for tag in tags_in(frame, self._camera):
            if tag.number == self._tag:
                self.add_corners(frame.time_s, tag.corners_px, odom_from_base)

    def add_corners(self, time_s: float, corners_px: FloatArray, odom_from_base: Pose2) -> None:
        """Add the tag as one frame shows it."""
        poses = tag_poses(corners_px, self._size_m, self._camera)
        if not poses:
            return
        self.count += 1
        self._seen.append(_Seen(time_s, odom_from_base, undistorted(corners_px, self._camera)))
        starts = [] if self._fit is None else [self._fit]
        for pose in poses:
            in_base = self._camera.base_from_optical() @ pose
            at = odom_from_base @ planar_pose(in_base)
            starts.append(np.array([at.x_m, at.y_m, in_base[2, 3], at.theta_rad]))
        self._fit = self._best(starts)

    @property
    def newest_s(self) -> float:
        """Time of the newest frame that showed the tag [s]."""
        return self._seen[-1].time_s if self._seen else -math.inf

    @property
    def odom_from_tag(self) -> Pose2 | None:
        """The pose: x and y of the centre, theta where it faces; None before the first frame with the tag."""
        if self._fit is None:
            return None
        x_m, y_m, _, theta_rad = self._fit.tolist()
        return Pose2(x_m=x_m, y_m=y_m, theta_rad=math.remainder(theta_rad, math.tau))

    def _best(self, starts: list[FloatArray]) -> FloatArray:
        """Minimize the weighted squares from each start (Gauss-Newton); return the best pose."""
        poses = np.array(
            [(s.odom_from_base.x_m, s.odom_from_base.y_m, s.odom_from_base.theta_rad) for s in self._seen]
        )
        corners = np.array([s.corners for s in self._seen])
        ages_s = np.array([s.time_s - self.newest_s for s in self._seen])
        weights = np.exp(0.5 * ages_s / FADING_S)[:, None]
        fits = []
        for fit in starts:
            for _ in range(ITERATIONS):
                residuals = self._residuals(fit, poses, corners, weights)
                jacobian = np.column_stack(
                    [
                        (self._residuals(fit + step, poses, corners, weights) - residuals) / STEP
                        for step in STEP * np.eye(4)
                    ]
                )
                fit = fit - np.linalg.lstsq(jacobian, residuals, rcond=None)[0]  # noqa: PLW2901
            fits.append((float(np.sum(self._residuals(fit, poses, corners, weights) ** 2)), fit))
        return min(fits, key=lambda each: each[0])[1]

    def _residuals(
        self, fit: FloatArray, poses: FloatArray, corners: FloatArray, weights: FloatArray
    ) -> FloatArray:
        """Return the differences between projected and seen corners in units of their noise, flat."""
        x_m, y_m, z_m, theta_rad = fit
        right, up = 0.5 * self._size_m * np.array([[-1, 1, 1, -1], [1, 1, -1, -1]])
        dx_m = x_m - math.sin(theta_rad) * right - poses[:, :1]
        dy_m = y_m + math.cos(theta_rad) * right - poses[:, 1:2]
        cos, sin = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
        points = np.stack(
            [cos * dx_m + sin * dy_m, cos * dy_m - sin * dx_m, np.broadcast_to(z_m + up, dx_m.shape)]
        )
        optical = np.tensordot(self._optical_from_base[:3, :3], points, axes=1)
        optical += self._optical_from_base[:3, 3, None, None]
        scale_px = (self._camera.fx_px, self._camera.fy_px)
        parts = []
        for axis, place_px in ((0, COLUMN_PX), (1, ROW_PX)):
            error_px = scale_px[axis] * (optical[axis] / optical[2] - corners[:, :, axis])
            middle_px = error_px.mean(axis=1, keepdims=True)
            parts += [weights * (error_px - middle_px) / SHAPE_PX, weights * middle_px / place_px]
        return np.concatenate([part.ravel() for part in parts])
