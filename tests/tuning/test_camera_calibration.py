"""`thumper calibrate camera`: rendered views of a chessboard give back the camera that took them."""

import importlib.util
import itertools
import os
import re
import select
import threading
import tomllib
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from thumper.cli.app import build_app
from thumper.common.errors import ThumperError

if importlib.util.find_spec("cv2") is None:
    pytest.skip("the extra `camera` is not installed", allow_module_level=True)

import cv2

COLUMNS, ROWS, SQUARE_M = 9, 6, 0.025
MATRIX = np.array([[612.0, 0.0, 327.0], [0.0, 608.0, 233.0], [0.0, 0.0, 1.0]])
DISTORTION = np.array([-0.12, 0.05, 0.001, -0.0005, 0.0])
SIZE_PX = (640, 480)


def view(
    turn: tuple[float, float, float], place_m: tuple[float, float, float], rng: np.random.Generator
) -> np.ndarray:
    """Render the board, its middle at `place_m` in the camera's frame, as an image with noise."""
    pixels = np.stack(np.meshgrid(np.arange(SIZE_PX[0]), np.arange(SIZE_PX[1])), axis=-1).reshape(-1, 1, 2)
    rays = cv2.undistortPoints(pixels.astype(np.float64), MATRIX, DISTORTION).reshape(-1, 2)
    rays = np.column_stack((rays, np.ones(len(rays))))
    rotation = cv2.Rodrigues(np.array(turn))[0]
    normal = rotation[:, 2]
    points = rays * ((normal @ place_m) / (rays @ normal))[:, None]
    on_board = (points - place_m) @ rotation[:, :2] / SQUARE_M + (0.5 * COLUMNS + 0.5, 0.5 * ROWS + 0.5)
    inside = (on_board > 0.0).all(axis=1) & (on_board < (COLUMNS + 1, ROWS + 1)).all(axis=1)
    is_black = inside & (np.floor(on_board).sum(axis=1) % 2 == 0)
    image = cv2.GaussianBlur(np.where(is_black, 30.0, 220.0).reshape(SIZE_PX[::-1]), (0, 0), 0.7)
    return np.asarray(np.clip(image + rng.normal(0.0, 3.0, image.shape), 0.0, 255.0).astype(np.uint8))


@pytest.fixture(scope="module")
def images() -> list[np.ndarray]:
    rng = np.random.default_rng(1)
    return [
        view(
            tuple(rng.uniform(-0.5, 0.5, 3) * (1.0, 1.0, 0.5)),
            (float(rng.uniform(-0.08, 0.08)), float(rng.uniform(-0.06, 0.06)), float(rng.uniform(0.35, 0.6))),
            rng,
        )
        for _ in range(16)
    ]


def calibrate(*options: str) -> str:
    board = ["--columns", str(COLUMNS), "--rows", str(ROWS), "--square", str(SQUARE_M)]
    done = CliRunner().invoke(build_app(), ["calibrate", "camera", *board, *options])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.output


def check(toml: str) -> None:
    camera = tomllib.loads(toml)["camera"]
    assert (camera["width_px"], camera["height_px"]) == SIZE_PX
    assert camera["fx_px"] == pytest.approx(MATRIX[0, 0], rel=0.005)
    assert camera["fy_px"] == pytest.approx(MATRIX[1, 1], rel=0.005)
    assert (camera["cx_px"], camera["cy_px"]) == pytest.approx((MATRIX[0, 2], MATRIX[1, 2]), abs=3.0)
    assert camera["distortion"][0] == pytest.approx(DISTORTION[0], abs=0.03)


def test_images_in_a_folder_give_the_intrinsics(images: list[np.ndarray], tmp_path: Path) -> None:
    for number, image in enumerate(images):
        cv2.imwrite(str(tmp_path / f"{number:02d}.png"), image)
    output = calibrate("--images", str(tmp_path), "--out", str(tmp_path / "out"))
    match = re.search(r"([\d.]+) pixels rms", output)
    assert match is not None
    assert float(match[1]) < 0.3
    check((tmp_path / "out" / "camera.toml").read_text())


@contextmanager
def streamed(images: list[np.ndarray]) -> Iterator[str]:
    """Send the images again and again, as mjpg-streamer does, to a terminal; yield its URL."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    os.set_blocking(ours, False)
    is_over = threading.Event()

    def send() -> None:
        for number, image in enumerate(itertools.cycle(images)):
            jpeg = cv2.imencode(".jpg", image)[1].tobytes()
            head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n"
            message = f"{head}X-Timestamp: {number}.0\r\n\r\n".encode() + jpeg
            while message:
                if is_over.is_set():
                    return
                if select.select([], [ours], [], 0.1)[1]:
                    message = message[os.write(ours, message[:2000]) :]

    thread = threading.Thread(target=send)
    thread.start()
    yield f"alt://{os.ttyname(theirs)}?class=Serial"
    is_over.set()
    thread.join()
    os.close(ours)
    os.close(theirs)


def test_a_live_camera_is_calibrated(images: list[np.ndarray], tmp_path: Path) -> None:
    with streamed(images) as url:
        config = tmp_path / "robot.toml"
        config.write_text(f'[camera]\nport = "{url}"\n')
        output = calibrate("--config", str(config), "--views", "8", "--out", str(tmp_path / "out"))
    assert "view 8 of 8" in output
    check((tmp_path / "out" / "camera.toml").read_text())


def test_the_wrong_board_is_refused(images: list[np.ndarray], tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "one.png"), images[0])
    with pytest.raises(
        ThumperError, match="1 different views of a chessboard of 9 x 6 inner corners, 8 are needed"
    ):
        calibrate("--images", str(tmp_path))
    with pytest.raises(ThumperError, match="none: no such folder"):
        calibrate("--images", str(tmp_path / "none"))
    (tmp_path / "empty").mkdir()
    with pytest.raises(ThumperError, match=r"no \.jpg or \.png image"):
        calibrate("--images", str(tmp_path / "empty"))
