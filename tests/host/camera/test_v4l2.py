"""The driver of USB cameras, on a recorded video in place of the device."""

import importlib.util
import time
from pathlib import Path

import numpy as np
import pytest

from thumper.camera.options import CameraOptions
from thumper.camera.v4l2 import V4l2Camera, open_v4l2
from thumper.common.errors import ThumperError
from thumper.common.sensor import GONE_ERRORS, ReopenedSensor

if importlib.util.find_spec("cv2") is None:
    pytest.skip("the extra `camera` is not installed", allow_module_level=True)

import cv2


@pytest.fixture
def video(tmp_path: Path) -> Path:
    path = tmp_path / "camera.avi"
    writer = cv2.VideoWriter(str(path), cv2.CAP_OPENCV_MJPEG, cv2.VideoWriter.fourcc(*"MJPG"), 30, (64, 48))
    for grey in (40, 80, 120):
        writer.write(np.full((48, 64, 3), grey, np.uint8))
    writer.release()
    return path


def test_frames_arrive_and_an_unplugged_camera_counts_as_gone(video: Path) -> None:
    before_s = time.monotonic()
    camera = V4l2Camera(cv2.VideoCapture(str(video)), name="video", latency_s=0.01)
    feed = ReopenedSensor("camera", camera, lambda: pytest.fail("opened at once"))
    frames = []
    while camera.counters.port_errors < GONE_ERRORS:
        frames += feed.poll()
    assert camera.counters.samples == 3  # the constructor took the first ones
    for frame in frames:
        assert before_s - 0.1 < frame.time_s < time.monotonic() - 0.01
        assert frame.grey().shape == (48, 64)
    camera.close()


class Yuyv:
    """A device that does not compress: raw frames, as `CAP_PROP_CONVERT_RGB` 0 gives them."""

    def read(self) -> tuple[bool, object]:
        time.sleep(0.01)
        return True, np.full((48, 64, 2), (80, 128), np.uint8)

    def get(self, _property: int) -> float:
        return 0.0

    def release(self) -> None:
        pass


def test_a_camera_that_does_not_compress_is_read() -> None:
    camera = V4l2Camera(Yuyv(), name="raw", latency_s=0.0)  # type: ignore[arg-type]
    grey = camera.wait_for_sample(5.0).grey()
    camera.close()
    assert grey.shape == (48, 64)
    assert grey.mean() == pytest.approx(75, abs=3)  # 80 of 16 to 235, as 0 to 255


def test_a_camera_without_frames_is_refused(video: Path) -> None:
    capture = cv2.VideoCapture(str(video))
    while capture.read()[0]:
        pass
    with pytest.raises(ThumperError, match="no frames from the camera video; check its cable") as refusal:
        V4l2Camera(capture, name="video", latency_s=0.0)
    assert refusal.value.exit_code == 3
    assert not capture.isOpened()


@pytest.mark.parametrize(
    ("port", "message"),
    [("/dev/video99", "there is no such port"), ("/dev/null", "it is busy, no camera, or")],
)
def test_a_port_that_is_no_camera_is_refused(
    port: str, message: str, capfd: pytest.CaptureFixture[str]
) -> None:
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_WARNING)
    with pytest.raises(ThumperError, match=f"cannot open the camera port {port}: {message}") as refusal:
        open_v4l2(CameraOptions(port=port))
    assert refusal.value.exit_code == 3
    assert capfd.readouterr().err == ""


def test_a_camera_of_another_size_is_refused(video: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    capture = cv2.VideoCapture(str(video))
    monkeypatch.setattr(cv2, "VideoCapture", lambda _port, _api: capture)
    with pytest.raises(ThumperError, match=r"sends 64 x 48 pixels; correct \[camera\] width_px") as refusal:
        open_v4l2(CameraOptions(port="/dev/null"))
    assert refusal.value.exit_code == 3
    assert not capture.isOpened()
