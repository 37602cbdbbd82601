"""Detections become places in the map: by bearing and lidar range, merged, dropped when they are gone."""

import importlib.util
import math

import numpy as np
import pytest

from thumper.camera.detector import Detection
from thumper.camera.options import CameraOptions
from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray, Pose2
from thumper.runtime.object_map import LOOKS, SIGHTINGS, ObjectMap
from thumper.runtime.object_place import View, place_of

if importlib.util.find_spec("cv2") is None:
    pytest.skip("the extra `camera` is not installed", allow_module_level=True)

CAMERA = CameraOptions(x_m=0.1, y_m=0.05, yaw_deg=20.0, distortion=(-0.2, 0.05, 0.0, 0.0, 0.0))
ROBOT = Pose2(x_m=1.0, y_m=2.0, theta_rad=0.7)
WALL_M = 4.0


def box_of(bearing_rad: float, half_rad: float) -> tuple[float, float, float, float]:
    """Return the box of an object at a bearing from the lens's axis."""
    import cv2

    rays = np.array([[-math.tan(bearing_rad + side * half_rad), 0.0, 1.0] for side in (1.0, -1.0)])
    pixels, _ = cv2.projectPoints(
        rays, np.zeros(3), np.zeros(3), CAMERA.matrix(), np.array(CAMERA.distortion)
    )
    (left_px, row_px), (right_px, _) = pixels.reshape(-1, 2).tolist()
    return left_px, row_px - 40.0, right_px, row_px + 40.0


def lens() -> Pose2:
    return ROBOT @ Pose2(x_m=CAMERA.x_m, y_m=CAMERA.y_m, theta_rad=math.radians(CAMERA.yaw_deg))


def view(time_s: float, *things: tuple[float, float, float]) -> View:
    """Return what the lidar sees: things (bearing, half width [rad], range [m]) before a round wall."""
    bearings = np.radians(np.arange(-40.0, 40.0, 0.35))
    ranges = np.full(bearings.size, WALL_M)
    for bearing_rad, half_rad, range_m in things:
        near = np.abs(bearings - bearing_rad) <= half_rad
        ranges[near] = np.minimum(ranges[near], range_m)
    hits: FloatArray = lens().apply(ranges[:, None] * np.column_stack((np.cos(bearings), np.sin(bearings))))
    return View(time_s=time_s, map_from_base=ROBOT, hits_in_map_m=hits)


def chair(bearing_rad: float, half_rad: float = 0.08, label: str = "chair") -> Detection:
    return Detection(label=label, score=0.9, box_px=box_of(bearing_rad, half_rad))


def expected(bearing_rad: float, range_m: float) -> tuple[float, float]:
    ((x_m, y_m),) = (
        lens().apply(range_m * np.array([[math.cos(bearing_rad), math.sin(bearing_rad)]])).tolist()
    )
    return x_m, y_m


@pytest.mark.parametrize("bearing_rad", [-0.3, 0.0, 0.25])
def test_the_lidar_gives_the_range_along_the_bearing(bearing_rad: float) -> None:
    at = place_of(box_of(bearing_rad, 0.08), view(0.0, (bearing_rad, 0.07, 1.8)), CAMERA)
    assert at == pytest.approx(expected(bearing_rad, 1.8), abs=0.02)


def test_thin_legs_before_a_wall_give_the_range_of_the_legs() -> None:
    legs = [(side * 0.05, 0.006, 1.5) for side in (-1.0, 1.0)]
    at = place_of(box_of(0.0, 0.08), view(0.0, *legs), CAMERA)
    assert at == pytest.approx(expected(0.0, 1.5), abs=0.02)


def test_without_a_hit_in_its_width_an_object_has_no_place() -> None:
    empty = View(time_s=0.0, map_from_base=ROBOT, hits_in_map_m=np.empty((0, 2)))
    assert place_of(box_of(0.0, 0.08), empty, CAMERA) is None


def test_sightings_of_one_object_merge_and_others_do_not() -> None:
    objects = ObjectMap()
    things = [(-0.2, 0.07, 1.5), (0.2, 0.07, 2.5)]
    for look in range(SIGHTINGS):
        assert objects.objects == ()
        detections = [chair(-0.2 + 0.01 * look), chair(0.2), chair(0.2, label="plant")]
        objects.look(detections, view(0.5 * look, *things), CAMERA)
    assert [(each.label, each.count) for each in objects.objects] == [
        ("chair", SIGHTINGS),
        ("chair", SIGHTINGS),
        ("plant", SIGHTINGS),
    ]
    near, far, _ = objects.objects
    assert (near.x_m, near.y_m) == pytest.approx(expected(-0.19, 1.5), abs=0.02)
    assert near.facing_rad == pytest.approx(math.atan2(ROBOT.y_m - near.y_m, ROBOT.x_m - near.x_m), abs=0.02)
    assert objects.nearest("Chair", ROBOT) is near
    assert objects.nearest("chair", Pose2(x_m=far.x_m, y_m=far.y_m)) is far


def test_an_unknown_object_is_refused_with_what_has_been_seen() -> None:
    objects = ObjectMap()
    with pytest.raises(ThumperError, match="no object 'sofa' on this map; none has been seen so far"):
        objects.nearest("sofa", ROBOT)
    for look in range(SIGHTINGS):
        objects.look([chair(0.0), chair(0.0, label="cup")], view(0.5 * look, (0.0, 0.07, 1.5)), CAMERA)
    with pytest.raises(ThumperError, match=r"no object 'sofa' on this map; seen so far: chair, cup$"):
        objects.nearest("sofa", ROBOT)


def seen() -> ObjectMap:
    """Return a map with a chair 1.5 m ahead."""
    objects = ObjectMap()
    for look in range(SIGHTINGS):
        objects.look([chair(0.0)], view(0.5 * look, (0.0, 0.07, 1.5)), CAMERA)
    return objects


def test_an_object_is_gone_when_the_lidar_looks_through_its_place() -> None:
    objects = seen()
    for look in range(LOOKS):
        assert len(objects.objects) == 1
        objects.look([], view(2.0 + 0.5 * look), CAMERA)
    assert objects.objects == ()


@pytest.mark.parametrize(
    "thing",
    [(0.0, 0.07, 1.5), (0.0, 0.07, 0.8)],
    ids=["the detector misses it", "something is in front of it"],
)
def test_an_object_that_may_still_be_there_stays(thing: tuple[float, float, float]) -> None:
    objects = seen()
    for look in range(3 * LOOKS):
        objects.look([], view(2.0 + 0.5 * look, thing), CAMERA)
    assert len(objects.objects) == 1


def test_an_object_out_of_view_stays() -> None:
    objects = seen()
    turned = ROBOT @ Pose2(theta_rad=math.pi / 2.0)
    for look in range(3 * LOOKS):
        here = view(2.0 + 0.5 * look)
        away = View(time_s=here.time_s, map_from_base=turned, hits_in_map_m=here.hits_in_map_m)
        objects.look([], away, CAMERA)
    assert len(objects.objects) == 1


def test_one_wrong_detection_is_forgotten() -> None:
    objects = ObjectMap()
    for look in range(6):  # a false alarm every 10 s
        objects.look([chair(0.0)], view(10.0 * look, (0.0, 0.07, 1.5)), CAMERA)
        objects.look([], view(10.0 * look + 6.0, (0.0, 0.07, 1.5)), CAMERA)
    assert objects.objects == ()
