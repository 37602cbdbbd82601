"""Find objects in a frame with a YOLO detector, as Ultralytics exports one to ONNX.

The format is that of `yolo export model=yolo11n.pt format=onnx`. Input: one RGB image of 0...1, shape
(1, 3, height, width). Output: (1, 4 + classes, N), in each column the centre, width and height of a box in
pixels of that input, and the scores of the classes. The metadata has the names of the classes.
"""

import ast
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from thumper.camera.frame import CameraFrame
from thumper.camera.options import CameraOptions
from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import FloatArray
from thumper.common.optional_packages import require_extra

if TYPE_CHECKING:
    from thumper.camera.frame import Image

THREADS = 2  # of a Raspberry Pi's four: the control loop keeps its own
PADDING_GREY = 114  # as in the training
MAX_BOXES = 300  # of an image; more take long to compare
MAX_OVERLAP = 0.5  # intersection over union, above which two boxes of a class show the same object
EXPORT = "export it again: yolo export model=yolo11n.pt format=onnx"


@dataclass(frozen=True, slots=True, kw_only=True)
class Detection:
    """An object in an image."""

    label: str
    score: float  # 0...1
    box_px: tuple[float, float, float, float]  # left, top, right, bottom


class Detector:
    """Call `find` with a frame; it may take a second."""

    def __init__(self, path: Path, min_score: float) -> None:
        """Load the file.

        Raises
        ------
        ThumperError
            There is no such file, or it is none of the format above; the message says how to fix it.
        """
        import onnxruntime

        if not path.is_file():
            raise ThumperError(
                f"{path}: no such file; correct [camera] detector, or {EXPORT}", exit_code=EXIT_USAGE
            )
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = THREADS
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")  # idle threads sleep
        options.log_severity_level = 4
        try:
            self._session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # each kind of damage has a type of its own
            raise ThumperError(f"{path}: not an ONNX file; {EXPORT}", exit_code=EXIT_USAGE) from error
        self._min_score = min_score
        metadata = self._session.get_modelmeta().custom_metadata_map
        self.labels = _labels(metadata, path)
        self._input = self._session.get_inputs()[0]
        self._height_px, self._width_px = _input_size(self._session.get_inputs(), metadata, path)
        _check_output(self._session.get_outputs(), len(self.labels), path)

    def find(self, frame: CameraFrame) -> list[Detection]:
        """Return the objects in a frame; raise ValueError if it is damaged."""
        image = frame.rgb()
        fitted, scale, left_px, top_px = letterbox(image, self._width_px, self._height_px)
        tensor = np.ascontiguousarray(fitted.transpose(2, 0, 1)[None], np.float32) / np.float32(255.0)
        columns = self._session.run(None, {self._input.name: tensor})[0][0]
        boxes_px, classes, scores = best_boxes(columns, self._min_score)
        boxes_px = (boxes_px - (left_px, top_px, left_px, top_px)) / scale
        height_px, width_px = image.shape[:2]
        boxes_px = np.clip(boxes_px, 0.0, (width_px, height_px, width_px, height_px))
        return [
            Detection(label=self.labels[number], score=score, box_px=(box[0], box[1], box[2], box[3]))
            for number, score, box in zip(classes.tolist(), scores.tolist(), boxes_px.tolist(), strict=True)
        ]


def open_detector(options: CameraOptions) -> Detector:
    """Load the configured detector; raises ThumperError if the extra or the file is missing or wrong."""
    require_extra("objects")
    return Detector(Path(options.detector), options.min_score)


def letterbox(image: "Image", width_px: int, height_px: int) -> tuple["Image", float, int, int]:
    """Fit an image, shape (h, w, 3), into a size with its proportions; grey fills the rest.

    Returns the fitted image, its scale, and the columns and rows before it.
    """
    import cv2

    rows, columns = image.shape[:2]
    scale = min(width_px / columns, height_px / rows)
    size = (max(1, round(scale * columns)), max(1, round(scale * rows)))
    left_px, top_px = (width_px - size[0]) // 2, (height_px - size[1]) // 2
    fitted = np.full((height_px, width_px, 3), PADDING_GREY, np.uint8)
    fitted[top_px : top_px + size[1], left_px : left_px + size[0]] = cv2.resize(image, size)
    return fitted, scale, left_px, top_px


def best_boxes(
    columns: NDArray[np.float32], min_score: float
) -> tuple[FloatArray, NDArray[np.int64], FloatArray]:
    """Return boxes (left, top, right, bottom), shape (n, 4) [pixels], classes and scores, best first.

    `columns`, shape (4 + classes, N), is the output of the network. Of boxes of one class that overlap, the
    one with the best score stays (non-maximum suppression).
    """
    scores = columns[4:].max(axis=0)
    classes = columns[4:].argmax(axis=0)
    chosen = np.flatnonzero(scores >= min_score)
    chosen = chosen[np.argsort(-scores[chosen], kind="stable")][:MAX_BOXES]
    centres, half = columns[:2, chosen].T, 0.5 * columns[2:4, chosen].T
    boxes = np.asarray(np.hstack((centres - half, centres + half)), np.float64)
    classes, kept = classes[chosen], []
    waiting = np.arange(chosen.size)
    while waiting.size:
        best, waiting = waiting[0], waiting[1:]
        kept.append(best)
        same = (classes[waiting] == classes[best]) & (_overlap(boxes[best], boxes[waiting]) > MAX_OVERLAP)
        waiting = waiting[~same]
    return boxes[kept], classes[kept], scores[chosen][kept].astype(np.float64)


def _overlap(box: FloatArray, others: FloatArray) -> FloatArray:
    """Return intersection over union of a box with others, shape (n, 4)."""
    low, high = np.maximum(box[:2], others[:, :2]), np.minimum(box[2:], others[:, 2:])
    common = np.prod(np.maximum(high - low, 0.0), axis=1)
    areas = np.prod(others[:, 2:] - others[:, :2], axis=1) + np.prod(box[2:] - box[:2])
    return np.asarray(common / np.maximum(areas - common, 1e-9), np.float64)


def _labels(metadata: dict[str, str], path: Path) -> list[str]:
    """Return the names of the classes from the metadata: "{0: 'person', 1: 'bicycle'}"."""
    try:
        names = ast.literal_eval(metadata["names"])
        names = names if isinstance(names, dict) else dict(enumerate(names))
        return [str(names[number]) for number in range(len(names))]
    except (KeyError, ValueError, SyntaxError, TypeError, MemoryError, RecursionError) as error:
        raise ThumperError(
            f"{path}: no class names in its metadata; {EXPORT}", exit_code=EXIT_USAGE
        ) from error


def _input_size(inputs: list[Any], metadata: dict[str, str], path: Path) -> tuple[int, int]:
    """Return height and width of the input; that of a dynamic one is in the metadata."""
    shape = list(inputs[0].shape)
    if len(inputs) != 1 or len(shape) != 4 or shape[1] != 3 or inputs[0].type != "tensor(float)":
        raise ThumperError(
            f"{path}: the input is {inputs[0].type} {shape}, expected one of tensor(float) [1, 3, height, "
            f"width]; {EXPORT}",
            exit_code=EXIT_USAGE,
        )
    if all(isinstance(size, int) for size in shape[2:]):
        return shape[2], shape[3]
    try:
        height_px, width_px = ast.literal_eval(metadata["imgsz"])
        return int(height_px), int(width_px)
    except (KeyError, ValueError, SyntaxError, TypeError) as error:
        raise ThumperError(
            f"{path}: neither its input nor its metadata has a size; {EXPORT}", exit_code=EXIT_USAGE
        ) from error


def _check_output(outputs: list[Any], classes: int, path: Path) -> None:
    shape = list(outputs[0].shape)
    if len(outputs) == 1 and len(shape) == 3 and shape[1] == 4 + classes:
        return
    raise ThumperError(
        f"{path}: the output is {shape}, expected one of [1, {4 + classes}, N] for its {classes} classes, as "
        f"YOLOv8 and YOLO11 have it; {EXPORT}",
        exit_code=EXIT_USAGE,
    )
