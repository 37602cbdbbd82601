"""Where a detected object is: the camera gives its bearing, the lidar its range."""

from dataclasses import dataclass

import numpy as np

from thumper.camera.options import CameraOptions
from thumper.camera.tags import undistorted
from thumper.common.geometry import FloatArray, Pose2

INNER_SHARE = 0.8  # of a box's width, in which beams count: its edges show what is behind the object
MIN_HITS = 2
GAP_M = 0.15  # in range, which ends the nearest cluster of hits
BESIDE_M = 0.1  # of the line of sight to an object, for hits that show what is there
BEYOND_M = 0.5  # behind its place, where all hits must be to show that it is gone


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """What the robot knew when a frame was exposed."""

    time_s: float
    map_from_base: Pose2
    hits_in_map_m: FloatArray  # of the newest scan, shape (n, 2)

    def map_from_lens(self, camera: CameraOptions) -> Pose2:
        """Return the pose of the lens; its axis is x."""
        direction = camera.base_from_optical()[:2, 2]
        yaw_rad = float(np.arctan2(direction[1], direction[0]))
        return self.map_from_base @ Pose2(x_m=camera.x_m, y_m=camera.y_m, theta_rad=yaw_rad)


def place_of(
    box_px: tuple[float, float, float, float], view: View, camera: CameraOptions
) -> tuple[float, float] | None:
    """Return x and y in the map of the side of the object that faces the robot.

    The nearest cluster of hits within the box's width gives the range. None if the lidar sees nothing there.
    """
    right_rad, left_rad = _bearings(box_px, camera)
    middle_rad, half_rad = 0.5 * (left_rad + right_rad), 0.5 * INNER_SHARE * (left_rad - right_rad)
    map_from_lens = view.map_from_lens(camera)
    hits_m = map_from_lens.inverse().apply(view.hits_in_map_m)
    bearings_rad = np.arctan2(hits_m[:, 1], hits_m[:, 0])
    hits_m = hits_m[np.abs(bearings_rad - middle_rad) <= half_rad]
    ranges_m = np.sort(np.hypot(hits_m[:, 0], hits_m[:, 1]))
    for cluster_m in np.split(ranges_m, np.flatnonzero(np.diff(ranges_m) > GAP_M) + 1):
        if cluster_m.size >= MIN_HITS:
            range_m = float(np.median(cluster_m))
            at = range_m * np.array([[np.cos(middle_rad), np.sin(middle_rad)]])
            ((x_m, y_m),) = map_from_lens.apply(at).tolist()
            return x_m, y_m
    return None


def is_empty(x_m: float, y_m: float, view: View, camera: CameraOptions) -> bool:
    """Return whether camera and lidar look through a place: it is in the image, and all hits are behind."""
    map_from_lens = view.map_from_lens(camera)
    to_lens = map_from_lens.inverse()
    ((ahead_m, left_m),) = to_lens.apply(np.array([[x_m, y_m]])).tolist()
    right_rad, left_rad = _bearings((0.0, 0.0, camera.width_px - 1.0, camera.height_px - 1.0), camera)
    middle_rad, half_rad = 0.5 * (left_rad + right_rad), 0.5 * INNER_SHARE * (left_rad - right_rad)
    bearing_rad = float(np.arctan2(left_m, ahead_m))
    if abs(bearing_rad - middle_rad) > half_rad:
        return False
    along = Pose2(theta_rad=bearing_rad).inverse()
    hits_m = along.apply(to_lens.apply(view.hits_in_map_m))
    hits_m = hits_m[(hits_m[:, 0] > 0.0) & (np.abs(hits_m[:, 1]) < BESIDE_M)]
    distance_m = float(np.hypot(ahead_m, left_m))
    return bool(hits_m.size and hits_m[:, 0].min() > distance_m + BEYOND_M)


def _bearings(box_px: tuple[float, float, float, float], camera: CameraOptions) -> tuple[float, float]:
    """Return the directions of a box's right and left edge from the lens, counter-clockwise from its axis."""
    left_px, top_px, right_px, bottom_px = box_px
    row_px = 0.5 * (top_px + bottom_px)
    edges_px = np.array([[right_px, row_px], [left_px, row_px]], dtype=np.float64)
    ideal = undistorted(edges_px, camera)
    rays = np.column_stack((ideal, np.ones(2))) @ camera.base_from_optical()[:3, :3].T
    direction = camera.base_from_optical()[:2, 2]
    axis_rad = np.arctan2(direction[1], direction[0])
    right_rad, left_rad = (np.arctan2(rays[:, 1], rays[:, 0]) - axis_rad).tolist()
    return float(right_rad), float(left_rad)
