"""Find AprilTags of the family 36h11 in a frame, and their poses in the plane of the robot.

A square of known size gives its pose from one view, but two poses fit nearly alike: they mirror the tag's
direction at the line of sight (Collins and Bartoli 2014, "Infinitesimal plane-based pose estimation"). Both
are returned, the better one first.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from thumper.camera.frame import CameraFrame, jpeg_shape
from thumper.camera.options import CameraOptions
from thumper.common.geometry import FloatArray, Pose2

UPRIGHT = 0.8  # cosine of the largest tilt between a tag's upward direction and the robot's
MAX_ERROR_PX = 1.5  # of a corner from where the pose projects it


@dataclass(frozen=True, slots=True, kw_only=True)
class TagCorners:
    """A tag in an image; corners in pixels, shape (4, 2), clockwise from the tag's top left."""

    number: int
    corners_px: FloatArray


@cache
def _detector() -> Any:
    from pyapriltags import Detector

    # At half the resolution tags are found three times as fast; their edges are refined in the whole image.
    return Detector(families="tag36h11", nthreads=1, quad_decimate=2.0)


def find_tags(grey: Any, detector: Any = None) -> list[TagCorners]:
    """Return the tags in an image, shape (height, width), of 8 bits; `detector` is one of pyapriltags."""
    detections = (detector or _detector()).detect(grey)
    return [
        # The library begins at the bottom left, counter-clockwise, and has the first pixel's centre at 0.5.
        TagCorners(number=each.tag_id, corners_px=np.asarray(each.corners, np.float64)[::-1] - 0.5)
        for each in detections
    ]


def tags_in(frame: CameraFrame, camera: CameraOptions) -> list[TagCorners]:
    """Return the tags in a frame, without numbers that occur twice; none if the frame is damaged."""
    try:
        if jpeg_shape(frame.jpeg) != (camera.height_px, camera.width_px):
            return []  # a device that changed its mode
        grey = frame.grey()
    except ValueError:
        return []
    found = find_tags(grey)
    numbers = [tag.number for tag in found]
    return [tag for tag in found if numbers.count(tag.number) == 1]


def tag_poses(corners_px: FloatArray, size_m: float, camera: CameraOptions) -> list[FloatArray]:
    """Return the poses optical_from_tag, shape (4, 4), that fit the corners of an upright tag, best first.

    The tag's frame: x to its right as seen, y up, z out of the wall.
    """
    import cv2

    half_m = 0.5 * size_m
    square_m = half_m * np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]], dtype=np.float64)
    _, turns, places, errors_px = cv2.solvePnPGeneric(
        square_m,
        corners_px,
        camera.matrix(),
        np.array(camera.distortion, dtype=np.float64),
        flags=cv2.SOLVEPNP_IPPE_SQUARE,
    )
    up = camera.base_from_optical()[2, :3]  # the robot's, in the optical frame
    found = []
    for turn, place, error_px in zip(turns, places, np.ravel(errors_px), strict=True):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = cv2.Rodrigues(turn)[0], np.ravel(place)
        if error_px <= MAX_ERROR_PX and float(up @ pose[:3, 1]) > UPRIGHT:
            found.append(pose)
    return found


def undistorted(corners_px: FloatArray, camera: CameraOptions) -> FloatArray:
    """Return the corners as an ideal camera of focal length 1 would see them, shape (n, 2)."""
    import cv2

    distortion = np.array(camera.distortion, dtype=np.float64)
    ideal = cv2.undistortPoints(corners_px.reshape(-1, 1, 2), camera.matrix(), distortion)
    return np.asarray(ideal, np.float64).reshape(-1, 2)


def planar_pose(base_from_tag: FloatArray) -> Pose2:
    """Project a pose to the plane; theta is where the tag faces."""
    x_m, y_m = base_from_tag[:2, 3]
    return Pose2(
        x_m=float(x_m),
        y_m=float(y_m),
        theta_rad=float(np.arctan2(base_from_tag[1, 2], base_from_tag[0, 2])),
    )
