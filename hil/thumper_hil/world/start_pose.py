"""Check a start pose: not in a wall or an obstacle, and not outside the room or the map."""

from collections.abc import Iterator

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper_hil.world.segment_raycast import inside_polygon
from thumper_hil.world.world import World

ROOM_SHARE = 0.5


def invalid_start_reason(world: World, pose: Pose2, footprint_m: FloatArray) -> str:
    """Return why a robot with this footprint, shape (k, 2), cannot start at `pose`; empty if it can.

    A closed wall that covers more than half of the world's extent is a room, and the robot must be inside.
    Other closed walls and boxes are solid. A world with neither room nor map has no outside.
    """
    if world.touches(pose, footprint_m):
        return "would stand in an obstacle"
    if any(inside_polygon(pose.x_m, pose.y_m, box) for box in world.boxes_m):
        return "would stand inside a box"
    extent_m2 = _extent_m2(world.segments_m.reshape(-1, 2))
    in_room = False
    for ring in _closed_walls(world):
        inside = inside_polygon(pose.x_m, pose.y_m, ring)
        is_room = _extent_m2(ring) > ROOM_SHARE * extent_m2
        if inside and not is_room:
            return "would stand inside a closed wall"
        if is_room and not inside:
            return "would stand outside the room"
        in_room |= is_room
    if world.grid is not None and not in_room:
        x_lo, y_lo, x_hi, y_hi = world.grid.bounds_m()
        if not (x_lo <= pose.x_m <= x_hi and y_lo <= pose.y_m <= y_hi):
            return "would stand outside the map"
    return ""


def _extent_m2(points_m: FloatArray) -> float:
    """Return the area of the bounding box of points, shape (n, 2); 0 for none."""
    return float(np.prod(np.ptp(points_m, axis=0))) if points_m.size else 0.0


def _closed_walls(world: World) -> Iterator[FloatArray]:
    """Yield the corners, shape (k, 2), of each closed run of segments that is not a box."""
    first = 0
    for last, segment in enumerate(world.segments_m):
        if np.array_equal(segment[2:], world.segments_m[first, :2]):
            ring = world.segments_m[first : last + 1, :2]
            if not any(np.array_equal(ring, box) for box in world.boxes_m):
                yield ring
            first = last + 1
        elif last + 1 < len(world.segments_m) and not np.array_equal(
            segment[2:], world.segments_m[last + 1, :2]
        ):
            first = last + 1
