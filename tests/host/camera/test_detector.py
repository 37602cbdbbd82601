"""The detector reads what Ultralytics exports, and refuses other files in one line."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from thumper.camera.frame import CameraFrame
from thumper.camera.options import CameraOptions
from thumper.common.errors import ThumperError

if not all(map(importlib.util.find_spec, ("cv2", "onnx", "onnxruntime"))):
    pytest.skip("the extra `objects` or onnx is not installed", allow_module_level=True)

import cv2
from onnx import helper

from tests.host.camera.onnx_models import colour_detector, constant_detector, save_model
from thumper.camera.detector import Detector, open_detector

RED, GREEN = (200, 30, 40), (40, 160, 60)
NAMES = {0: "chair", 1: "potted plant"}


def frame(image: np.ndarray) -> CameraFrame:
    """Return a frame of an image, shape (height, width, 3), red first."""
    jpeg = cv2.imencode(".jpg", image[..., ::-1], (cv2.IMWRITE_JPEG_QUALITY, 95))[1].tobytes()
    return CameraFrame(time_s=0.0, jpeg=jpeg)


GREY = frame(np.full((240, 320, 3), 128, np.uint8))


@pytest.mark.parametrize("size", [(640, 480), (320, 240), (480, 640), (1280, 640)])
def test_boxes_are_in_pixels_of_the_frame(size: tuple[int, int], tmp_path: Path) -> None:
    """A network that knows two colours needs the right order of channels, scale and proportions."""
    width_px, height_px = size
    image = np.full((height_px, width_px, 3), 128, np.uint8)
    left, top, right, bottom = (round(share * width_px) for share in (0.25, 0.1, 0.5, 0.3))
    image[top:bottom, left:right] = RED
    image[bottom + 20 : bottom + 60, right + 20 : right + 80] = GREEN
    detector = Detector(colour_detector(tmp_path / "d.onnx", {"chair": RED, "plant": GREEN}), 0.5)
    found = {each.label: each for each in detector.find(frame(image))}
    assert set(found) == {"chair", "plant"}
    tolerance_px = 2.0 * max(1.0, width_px / 640.0)
    assert found["chair"].box_px == pytest.approx((left, top, right, bottom), abs=tolerance_px)
    assert found["chair"].score > 0.9
    assert found["plant"].box_px == pytest.approx(
        (right + 20, bottom + 20, right + 80, bottom + 60), abs=tolerance_px
    )


def test_of_overlapping_boxes_of_a_class_the_best_stays(tmp_path: Path) -> None:
    columns = [
        (300, 300, 100, 100, 0.7, 0.0),
        (305, 300, 100, 100, 0.9, 0.0),
        (310, 300, 100, 100, 0.0, 0.6),  # of another class
        (500, 300, 100, 100, 0.8, 0.0),
        (100, 300, 100, 100, 0.49, 0.0),
        (100, 300, np.nan, 100, np.nan, 0.0),
    ]
    detector = Detector(constant_detector(tmp_path / "d.onnx", columns, NAMES), 0.5)
    found = detector.find(GREY)
    assert [(each.label, round(each.score, 2)) for each in found] == [
        ("chair", 0.9),
        ("chair", 0.8),
        ("potted plant", 0.6),
    ]
    # Input of 640 x 640: twice the frame, 80 rows of padding above it.
    assert found[0].box_px == pytest.approx((127.5, 85.0, 177.5, 135.0))


def test_the_size_of_a_dynamic_input_is_in_the_metadata(tmp_path: Path) -> None:
    nodes = [
        helper.make_node("ReduceMean", ["images"], ["mean"], axes=[1, 2, 3], keepdims=0),
        helper.make_node("Shape", ["images"], ["shape"]),
        helper.make_node("Cast", ["shape"], ["sizes"], to=1),
        helper.make_node("Concat", ["sizes", "mean"], ["column"], axis=0),
        helper.make_node("Reshape", ["column", "as"], ["output0"]),
    ]
    path = save_model(
        tmp_path / "d.onnx",
        nodes,
        {"as": np.array([1, 5, 1])},
        output=("batch", 5, "anchors"),
        names={0: "brightness"},
        input_shape=("batch", 3, "height", "width"),
        imgsz="[320, 416]",
    )
    (found,) = Detector(path, 0.1).find(frame(np.full((320, 416, 3), 255, np.uint8)))
    assert found.score == pytest.approx(1.0, abs=0.01)  # of 0...1
    # "x, y, width, height" are 1, 3, 320, 416: the shape of the input.
    assert found.box_px == pytest.approx((0.0, 0.0, 161.0, 211.0))


def test_a_damaged_frame_is_a_value_error(tmp_path: Path) -> None:
    detector = Detector(constant_detector(tmp_path / "d.onnx", [(1, 1, 1, 1, 1)], {0: "cup"}), 0.5)
    with pytest.raises(ValueError, match="frame"):
        detector.find(CameraFrame(time_s=0.0, jpeg=GREY.jpeg[:100]))


def refused(path: Path, kind: str) -> None:
    """Write a file that is none of the format."""
    identity = [helper.make_node("Identity", ["table"], ["output0"])]
    with_boxes = {"table": np.zeros((1, 300, 6), np.float32)}  # exported with end2end or nms=True
    table = {"table": np.zeros((1, 6, 8400), np.float32)}
    if kind == "garbage":
        path.write_bytes(b"\x08\x07 not protobuf")
    elif kind == "end to end":
        save_model(path, identity, with_boxes, output=(1, 300, 6), names=NAMES)
    elif kind == "unnamed":
        save_model(path, identity, table, output=(1, 6, 8400), names=None)
    elif kind == "grey":
        save_model(path, identity, table, output=(1, 6, 8400), names=NAMES, input_shape=(1, 1, 640, 640))
    elif kind == "sizeless":
        shape = (1, 3, "height", "width")
        save_model(path, identity, table, output=(1, 6, 8400), names=NAMES, input_shape=shape)


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        ("missing", "no such file"),
        ("garbage", "not an ONNX file"),
        ("end to end", r"the output is \[1, 300, 6\], expected one of \[1, 6, N\] for its 2 classes"),
        ("unnamed", "no class names"),
        ("grey", r"the input is tensor\(float\) \[1, 1, 640, 640\], expected"),
        ("sizeless", "neither its input nor its metadata has a size"),
    ],
)
def test_another_file_is_refused_in_one_line(kind: str, reason: str, tmp_path: Path) -> None:
    path = tmp_path / "detector.onnx"
    refused(path, kind)
    with pytest.raises(ThumperError, match=reason) as refusal:
        Detector(path, 0.5)
    assert str(refusal.value).startswith(f"{path}: ")
    assert "yolo export" in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_without_onnxruntime_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(ThumperError, match=r"pip install 'thumper-robot\[objects\]'$"):
        open_detector(CameraOptions(enabled=True, detector="any.onnx"))
