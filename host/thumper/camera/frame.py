"""One frame of a camera, as all drivers deliver it, and the checks of its header.

A few bytes of a JPEG may claim billions of pixels, or thousands of passes over them. So the header is read
before the image is decoded (ITU T.81, annex B).
"""

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    Image = NDArray[np.uint8]

MAX_PIXELS = 20_000_000  # 5000 x 4000
MAX_SCANS = 16  # a usual image has 1, a progressive one about 10; each is a pass over all pixels
START, SCAN = 0xD8, 0xDA
SIZES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # markers of a segment with the image's size
WITHOUT_LENGTH = {0x01, *range(0xD0, 0xDA)}


def jpeg_shape(jpeg: bytes) -> tuple[int, int]:
    """Return height and width as the header of a JPEG image claims them.

    Raises
    ------
    ValueError
        The bytes are no JPEG image, its header is damaged, or it claims too many pixels or passes.
    """
    if not jpeg.startswith(bytes((0xFF, START))):
        raise ValueError("the frame is not a JPEG image")
    at = 2
    while len(jpeg) >= at + 9 and jpeg[at] == 0xFF:
        marker = jpeg[at + 1]
        if marker == SCAN or marker in WITHOUT_LENGTH:
            break
        if marker == 0xFF:  # a fill byte
            at += 1
            continue
        length, _, height, width = struct.unpack_from(">HBHH", jpeg, at + 2)
        if marker in SIZES:
            scans = jpeg.count(bytes((0xFF, SCAN)))
            if not (0 < height * width <= MAX_PIXELS and 0 < scans <= MAX_SCANS):
                raise ValueError(f"a frame of {width} x {height} pixels in {scans} passes")
            return height, width
        at += 2 + length
    raise ValueError("the frame has a damaged header")


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraFrame:
    """A JPEG image; most USB cameras compress their frames themselves."""

    time_s: float  # of the middle of the exposure, on the host's clock
    jpeg: bytes

    def grey(self) -> "Image":
        """Decode to shape (height, width); raise ValueError if the bytes are damaged, as `jpeg_shape`."""
        import cv2

        return self._decoded(cv2.IMREAD_GRAYSCALE)

    def rgb(self) -> "Image":
        """Decode to shape (height, width, 3); raise ValueError if the bytes are damaged, as `jpeg_shape`."""
        import cv2

        return self._decoded(cv2.IMREAD_COLOR_RGB)

    def _decoded(self, colours: int) -> "Image":
        import cv2

        jpeg_shape(self.jpeg)
        as_sent = colours | cv2.IMREAD_IGNORE_ORIENTATION  # the intrinsics are for that
        try:
            image = cv2.imdecode(np.frombuffer(self.jpeg, np.uint8), as_sent)
        except cv2.error as error:
            raise ValueError("the frame cannot be decoded") from error
        if image is None:
            raise ValueError("the frame cannot be decoded")
        return np.asarray(image, np.uint8)
