"""Driver of USB cameras: frames by OpenCV from Video4Linux, read in a thread of its own.

`VideoCapture.read` waits for the next frame, which the robot's loop must not do.
"""

import threading
import time
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING

from thumper.camera.frame import CameraFrame, jpeg_shape
from thumper.camera.options import CameraOptions
from thumper.common.closable import Closable
from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.common.sensor import SensorCounters
from thumper.common.serial_port import no_such_port

if TYPE_CHECKING:
    import cv2

START_TIMEOUT_S = 5.0
WAITING_FRAMES = 8  # older ones are dropped
SAME_CLOCK_S = 1.0  # a stamp that is farther from now is not on the monotonic clock
JPEG_QUALITY = 90


def open_v4l2(options: CameraOptions) -> "cv2.VideoCapture":
    """Open the device, and ask it for JPEG images as it compresses them.

    Raises
    ------
    ThumperError
        There is no such device, or it sends other images than the intrinsics are for.
    """
    import cv2

    if not Path(options.port).exists():
        raise no_such_port(options.port, "camera")
    # Or it writes a line of its own before the error.
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    capture = cv2.VideoCapture(options.port, cv2.CAP_V4L2)
    if not capture.isOpened():
        raise ThumperError(
            f"cannot open the camera port {options.port}: it is busy, no camera, or access is denied; "
            "close other programs, and add yourself to its group: sudo usermod -aG video $USER",
            exit_code=EXIT_NOT_THERE,
        )
    capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG"))
    capture.set(cv2.CAP_PROP_FRAME_WIDTH, options.width_px)
    capture.set(cv2.CAP_PROP_FRAME_HEIGHT, options.height_px)
    capture.set(cv2.CAP_PROP_FPS, options.rate_Hz)
    capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)
    try:
        height_px, width_px = (
            capture.get(size) for size in (cv2.CAP_PROP_FRAME_HEIGHT, cv2.CAP_PROP_FRAME_WIDTH)
        )
        options.check_shape((round(height_px), round(width_px)))
    except BaseException:
        capture.release()
        raise
    return capture


class V4l2Camera(Closable):
    """A camera. The constructor waits for the first frame; `poll` never waits."""

    def __init__(self, capture: "cv2.VideoCapture", *, name: str, latency_s: float) -> None:
        """Read `capture`, which it closes, in a thread; `name` is the device in messages.

        Raises
        ------
        ThumperError
            No frame arrives (exit code 3).
        """
        self.counters = SensorCounters()
        self._capture, self._name, self._latency_s = capture, name, latency_s
        self._frames: deque[CameraFrame] = deque(maxlen=WAITING_FRAMES)
        self._arrived = threading.Event()
        self._closing = False
        self._thread = threading.Thread(target=self._read, name="camera", daemon=True)
        self._thread.start()
        try:
            self.wait_for_sample(START_TIMEOUT_S)
        except BaseException:
            self.close()
            raise

    def poll(self) -> list[CameraFrame]:
        """Return the frames that have arrived since the last call, oldest first. Never waits or raises."""
        self._arrived.clear()
        found = [self._frames.popleft() for _ in range(len(self._frames))]
        self.counters.samples += len(found)
        if not found and not self._thread.is_alive():
            self.counters.port_errors += 1
        return found

    def wait_for_sample(self, timeout_s: float) -> CameraFrame:
        """Wait for the next frame; raise ThumperError if none arrives in time."""
        until_s = time.monotonic() + timeout_s
        while (left_s := until_s - time.monotonic()) > 0.0:
            self._arrived.wait(left_s)
            if found := self.poll():
                return found[-1]
            if not self._thread.is_alive():
                break
        sent = "no JPEG images" if self.counters.bad_replies else "no frames"
        raise ThumperError(f"{sent} from the camera {self._name}; check its cable", exit_code=EXIT_NOT_THERE)

    def now_s(self) -> float:
        """Return the time [s] on the clock of the frames' stamps."""
        return time.monotonic()

    def close(self) -> None:
        """Close the device."""
        self._closing = True
        self._thread.join(START_TIMEOUT_S)
        self._capture.release()

    def _read(self) -> None:
        import cv2

        while not self._closing:
            ok, image = self._capture.read()
            now_s = time.monotonic()
            if not ok:  # unplugged
                break
            stamp_s = 1e-3 * self._capture.get(cv2.CAP_PROP_POS_MSEC)  # of the kernel
            if abs(stamp_s - now_s) > SAME_CLOCK_S:
                stamp_s = now_s
            jpeg = bytes(image)
            if image.ndim == 3 and image.shape[2] in (2, 3):  # this camera does not compress: YUYV or BGR
                if image.shape[2] == 2:
                    image = cv2.cvtColor(image, cv2.COLOR_YUV2BGR_YUY2)
                jpeg = bytes(cv2.imencode(".jpg", image, (cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY))[1])
            try:
                jpeg_shape(jpeg)
            except ValueError:
                self.counters.bad_replies += 1
                continue
            self._frames.append(CameraFrame(time_s=stamp_s - self._latency_s, jpeg=jpeg))
            self._arrived.set()
        self._arrived.set()
