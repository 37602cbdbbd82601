"""`thumper calibrate camera`: a camera's intrinsics from views of a chessboard, by OpenCV (Zhang 2000)."""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from thumper.camera.open_camera import open_camera
from thumper.camera.options import CameraOptions
from thumper.common.errors import EXIT_CHECK_FAILED, EXIT_USAGE, ThumperError
from thumper.common.geometry import FloatArray

NEW_VIEW = 0.05  # mean shift of the corners against each earlier view, in image widths
FRAME_TIMEOUT_S, PATIENCE_S = 3.0, 30.0
FEWEST_VIEWS = 8
GOOD_RMS_PX = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Chessboard:
    """Inner corners per row and per column, and the edge of a square."""

    columns: int
    rows: int
    square_m: float

    def find(self, grey: Any) -> FloatArray | None:
        """Return the corners in pixels, shape (columns * rows, 2); None if not all are in view."""
        found, corners = cv2.findChessboardCornersSB(grey, (self.columns, self.rows))
        return np.asarray(corners, np.float64).reshape(-1, 2) if found else None

    def corners_m(self) -> FloatArray:
        """Return the corners on the board, shape (columns * rows, 3)."""
        grid = np.mgrid[0 : self.columns, 0 : self.rows].T.reshape(-1, 2)
        return np.asarray(self.square_m * np.column_stack((grid, np.zeros(len(grid)))))


@dataclass(frozen=True, slots=True, kw_only=True)
class Intrinsics:
    """What `[camera]` needs, and how well it fits."""

    shape: tuple[int, int]  # height and width of the images
    matrix: FloatArray  # shape (3, 3)
    distortion: FloatArray  # k1, k2, p1, p2, k3
    rms_px: float
    focal_std_px: float

    def toml(self) -> str:
        """Return the keys of `[camera]`."""
        (fx_px, _, cx_px), (_, fy_px, cy_px), _ = self.matrix.tolist()
        distortion = ", ".join(f"{value:.5f}" for value in self.distortion)
        return (
            f"[camera]\nwidth_px = {self.shape[1]}\nheight_px = {self.shape[0]}\n"
            f"fx_px = {fx_px:.2f}\nfy_px = {fy_px:.2f}\ncx_px = {cx_px:.2f}\ncy_px = {cy_px:.2f}\n"
            f"distortion = [{distortion}]\n"
        )


def frames_of(options: CameraOptions) -> Iterator[Any]:
    """Yield the frames of the camera, shape (height, width); raises ThumperError if it is silent."""
    camera = open_camera(options)
    try:
        while True:
            yield camera.wait_for_sample(FRAME_TIMEOUT_S).grey()
    finally:
        camera.close()


def images_of(folder: Path) -> Iterator[Any]:
    """Yield the images of a folder, by name; raises ThumperError if there is none."""
    if not folder.is_dir():
        raise ThumperError(f"{folder}: no such folder", exit_code=EXIT_USAGE)
    paths = sorted(path for path in folder.glob("*") if path.suffix.lower() in {".jpg", ".jpeg", ".png"})
    if not paths:
        raise ThumperError(f"{folder}: no .jpg or .png image in it", exit_code=EXIT_USAGE)
    for path in paths:
        image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        if image is None:
            raise ThumperError(f"{path}: not an image", exit_code=EXIT_USAGE)
        yield image


def calibrate(
    frames: Iterator[Any], board: Chessboard, *, views: int, patience_s: float = PATIENCE_S
) -> Intrinsics:
    """Collect `views` views that differ, or fewer if no new one comes for `patience_s`; return their fit.

    Raises
    ------
    ThumperError
        The frames differ in size, too few show the board, or the fit is poor.
    """
    found: list[FloatArray] = []
    shape: tuple[int, int] | None = None
    newest_s = time.monotonic()
    for grey in frames:
        shape = shape or grey.shape
        if grey.shape != shape:
            raise ThumperError("the images differ in size: take all with one camera", exit_code=EXIT_USAGE)
        corners_px = board.find(grey)
        if corners_px is not None and all(_shift(corners_px, other) > NEW_VIEW * shape[1] for other in found):
            found.append(corners_px)
            newest_s = time.monotonic()
            print(f"view {len(found)} of {views}", flush=True)
        if len(found) == views or time.monotonic() - newest_s > patience_s:
            break
    if shape is None or len(found) < FEWEST_VIEWS:
        raise ThumperError(
            f"{len(found)} different views of a chessboard of {board.columns} x {board.rows} inner corners, "
            f"{FEWEST_VIEWS} are needed: show it whole, tilted, near and far, and at all edges of the image",
            exit_code=EXIT_CHECK_FAILED,
        )
    return _fit(found, board, shape)


def _shift(corners_px: FloatArray, other_px: FloatArray) -> float:
    return float(np.linalg.norm(corners_px - other_px, axis=1).mean())


def _fit(views_px: list[FloatArray], board: Chessboard, shape: tuple[int, int]) -> Intrinsics:
    corners_m = [board.corners_m().astype(np.float32)] * len(views_px)
    corners_px = [view.astype(np.float32) for view in views_px]
    size_px = (shape[1], shape[0])
    rms_px, matrix, distortion, _, _, stds, _, _ = cv2.calibrateCameraExtended(
        corners_m, corners_px, size_px, np.eye(3), np.zeros(5)
    )
    if not (math.isfinite(rms_px) and rms_px < GOOD_RMS_PX):
        raise ThumperError(
            f"the views contradict each other by {rms_px:.1f} pixels rms: is the board flat, with "
            f"{board.columns} x {board.rows} inner corners?",
            exit_code=EXIT_CHECK_FAILED,
        )
    return Intrinsics(
        shape=shape,
        matrix=np.asarray(matrix, np.float64),
        distortion=np.asarray(distortion, np.float64).ravel()[:5],
        rms_px=float(rms_px),
        focal_std_px=float(np.ravel(stds)[:2].max()),
    )
