"""Sills and thresholds: low bars on the floor that no lidar sees and every axle climbs."""

import math

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper_hil.effects.body_parts import body_parts
from thumper_hil.world.segment_raycast import WallSegment, point_segment_m

WHEELS = body_parts().wheels


def pitch_over_sills_rad(pose: Pose2, sills_m: FloatArray) -> float:
    """Return the pitch of a robot whose axles stand on sills, shape (n, 5); positive with the front down."""
    if not sills_m.size:
        return 0.0
    rear, front = axles_m(pose)
    return math.atan2(_height_m(rear, sills_m) - _height_m(front, sills_m), 2.0 * WHEELS.axle_m)


def axles_m(pose: Pose2) -> FloatArray:
    """Return the middle of the rear and of the front axle, shape (2, 2)."""
    return pose.apply(np.array([[-WHEELS.axle_m, 0.0], [WHEELS.axle_m, 0.0]]))


def _height_m(point_m: FloatArray, sills_m: FloatArray) -> float:
    highest_m = 0.0
    for x0, y0, x1, y1, height_m in sills_m:
        if point_segment_m(point_m[0], point_m[1], WallSegment(x0, y0, x1, y1)) < WHEELS.sill_half_width_m:
            highest_m = max(highest_m, height_m)
    return highest_m
