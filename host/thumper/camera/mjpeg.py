"""Driver of cameras that send a stream of JPEG images with stamps, as the simulated one does.

The stream is multipart/x-mixed-replace, as mjpg-streamer sends it: each image has a header with
`Content-Length` and `X-Timestamp`, in seconds.
"""

import re
from collections.abc import Iterator

from thumper.camera.frame import CameraFrame, jpeg_shape
from thumper.common.sensor import StreamSensor
from thumper.common.serial_port import SerialPort

HEADER_END = b"\r\n\r\n"
HEADER = re.compile(
    rb"--\S{1,70}\r\nContent-Type: image/jpeg\r\nContent-Length: (\d{1,9})\r\nX-Timestamp: ([\d.]{1,30})"
)
MAX_BYTES = 4_000_000  # of an image
START_TIMEOUT_S = 2.5


class MjpegDecoder:
    """Splits bytes into images; drops and counts those that are damaged."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.good, self.bad = 0, 0

    def feed(self, data: bytes) -> Iterator[tuple[float, bytes]]:
        """Yield stamp [s] and bytes of each image that ends in these bytes."""
        self._buffer += data
        while (end := self._buffer.find(HEADER_END)) >= 0:
            headers = list(HEADER.finditer(self._buffer, 0, end))
            header = headers[-1] if headers else None
            length = int(header[1]) if header is not None else 0
            if header is None or header.end() != end or length > MAX_BYTES:
                self.bad += self.good > 0  # the first one has begun before the port was opened
                del self._buffer[: end + len(HEADER_END)]
                continue
            start = end + len(HEADER_END)
            if len(self._buffer) < start + length:
                return
            image = bytes(self._buffer[start : start + length])
            try:
                stamp_s = float(header[2])
                jpeg_shape(image)
            except ValueError:
                self.bad += 1
                del self._buffer[:start]  # the next header may be in what seemed to be the image
                continue
            del self._buffer[: start + length]
            self.good += 1
            yield stamp_s, image
        del self._buffer[: max(0, len(self._buffer) - MAX_BYTES)]


class MjpegDriver(StreamSensor[CameraFrame]):
    """A streaming camera. The constructor waits for the first frame; `poll` never waits."""

    NAME = "camera"

    def __init__(self, port: SerialPort, *, latency_s: float) -> None:
        """Read `port` until the first frame arrives.

        Raises
        ------
        ThumperError
            No data arrives, or no images (exit code 3).
        """
        super().__init__(port)
        self._decoder = MjpegDecoder()
        self._latency_s = latency_s
        self.shape = (0, 0)  # height and width of the first frame
        foreign = f"the device on {port.url} sends no images; correct [camera] port"
        self._start(START_TIMEOUT_S, self._recognizes, foreign=foreign)

    def _recognizes(self, data: bytes) -> bool:
        for _, image in self._decoder.feed(data):
            self.shape = jpeg_shape(image)
        return self.shape != (0, 0)

    def _decode(self, data: bytes, now_s: float) -> list[CameraFrame]:
        found = [
            CameraFrame(time_s=stamp_s - self._latency_s, jpeg=image)
            for stamp_s, image in self._decoder.feed(data)
        ]
        self.counters.bad_replies = self._decoder.bad
        return found
