"""Zones, places, tags and objects as MarkerArrays, which RViz and Foxglove draw in the map."""

from collections.abc import Iterable, Iterator

import numpy as np

from thumper.common.geometry import Pose2
from thumper.maps.annotations import Annotations, SavedPlace, SavedTag, Zone, ZoneKind
from thumper.ros.codec import Message, message
from thumper.ros.to_ros import MAP, Messages, pose_message

# Values of visualization_msgs/Marker.
ARROW, SPHERE, LINE_STRIP, TEXT = 0, 2, 4, 9
ADD, DELETE_ALL = 0, 3
LINE_WIDTH_M, TEXT_HEIGHT_M, SPHERE_M, ARROW_M = 0.04, 0.2, 0.15, (0.4, 0.06, 0.06)
RED, AMBER, BLUE = (0.82, 0.14, 0.18), (0.85, 0.55, 0.0), (0.18, 0.5, 0.97)
OBJECT = "object"  # namespace of the labels of objects


def markers(messages: Messages, time_s: float, annotations: Annotations) -> Message:
    """Build the MarkerArray; its first marker deletes those of the message before."""
    header = messages.header(time_s, MAP)
    found = [_delete_all(header)]
    for number, item in enumerate(annotations):
        found += _zone(header, number, item) if isinstance(item, Zone) else _place(header, number, item)
    return message("visualization_msgs/msg/MarkerArray", markers=found)


def object_markers(messages: Messages, time_s: float, objects: Iterable[tuple[str, float, float]]) -> Message:
    """Build the MarkerArray of objects: label, x and y [m] of each; the text of a label is at its place."""
    header = messages.header(time_s, MAP)
    found = [_delete_all(header)]
    for number, (label, x_m, y_m) in enumerate(objects):
        at = _marker(header, SPHERE, AMBER, (SPHERE_M,) * 3)
        at.pose = pose_message(x_m, y_m, 0.0)
        at.ns, at.id = "place", number
        text = _label(header, number, label, Pose2(x_m=x_m, y_m=y_m))
        text.ns = OBJECT
        found += [at, text]
    return message("visualization_msgs/msg/MarkerArray", markers=found)


def objects_of(msg: Message) -> list[tuple[str, float, float]]:
    """Return label, x and y [m] of each object in a MarkerArray of `object_markers`."""
    labels = [marker for marker in msg.markers if marker.ns == OBJECT and marker.type == TEXT]
    return [(label.text, label.pose.position.x, label.pose.position.y) for label in labels]


def _delete_all(header: Message) -> Message:
    marker = _marker(header, ARROW, BLUE, ARROW_M)
    marker.action = DELETE_ALL
    return marker


def _zone(header: Message, number: int, zone: Zone) -> Iterator[Message]:
    colour = RED if zone.kind is ZoneKind.KEEPOUT else AMBER
    text = zone.name if zone.kind is ZoneKind.KEEPOUT else f"{zone.name}: {zone.speed_percent} %"
    ring = (*zone.vertices_m, zone.vertices_m[0])
    outline = _marker(header, LINE_STRIP, colour, (LINE_WIDTH_M, 0.0, 0.0))
    outline.points = [message("geometry_msgs/msg/Point", x=x_m, y=y_m, z=0.0) for x_m, y_m in ring]
    outline.ns, outline.id = zone.kind.value, number
    yield outline
    x_m, y_m = zone.polygon_m().mean(axis=0).tolist()
    yield _label(header, number, text, Pose2(x_m=x_m, y_m=y_m))


def _place(header: Message, number: int, place: SavedPlace | SavedTag) -> Iterator[Message]:
    shape, scale = (SPHERE, (SPHERE_M,) * 3) if place.yaw_rad is None else (ARROW, ARROW_M)
    at = _marker(header, shape, BLUE, scale)
    at.pose = pose_message(place.x_m, place.y_m, place.yaw_rad or 0.0)
    at.ns, at.id = "place", number
    yield at
    yield _label(header, number, place.name, Pose2(x_m=place.x_m, y_m=place.y_m + TEXT_HEIGHT_M))


def _label(header: Message, number: int, text: str, at: Pose2) -> Message:
    label = _marker(header, TEXT, BLUE, (0.0, 0.0, TEXT_HEIGHT_M))
    label.pose = pose_message(at.x_m, at.y_m, 0.0)
    label.ns, label.id, label.text = "name", number, text
    return label


def _marker(
    header: Message, shape: int, colour: tuple[float, float, float], scale: tuple[float, ...]
) -> Message:
    red, green, blue = colour
    nothing = np.empty(0, dtype=np.uint8)
    return message(
        "visualization_msgs/msg/Marker",
        header=header,
        ns="",
        id=0,
        type=shape,
        action=ADD,
        pose=pose_message(0.0, 0.0, 0.0),
        scale=message("geometry_msgs/msg/Vector3", x=scale[0], y=scale[1], z=scale[2]),
        color=message("std_msgs/msg/ColorRGBA", r=red, g=green, b=blue, a=1.0),
        lifetime=message("builtin_interfaces/msg/Duration", sec=0, nanosec=0),  # for ever
        frame_locked=False,
        points=[],
        colors=[],
        texture_resource="",
        texture=message("sensor_msgs/msg/CompressedImage", header=header, format="", data=nothing),
        uv_coordinates=[],
        text="",
        mesh_resource="",
        mesh_file=message("visualization_msgs/msg/MeshFile", filename="", data=nothing),
        mesh_use_embedded_materials=False,
    )
