"""One frame of a camera, as all drivers deliver it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    GreyImage = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraFrame:
    """A JPEG image; most USB cameras compress their frames themselves."""

    time_s: float  # of the middle of the exposure, on the host's clock
    jpeg: bytes

    def grey(self) -> "GreyImage":
        """Decode to shape (height, width); raise ValueError if the bytes are damaged."""
        import cv2

        image = cv2.imdecode(np.frombuffer(self.jpeg, np.uint8), cv2.IMREAD_GRAYSCALE)
        if image is None:
            raise ValueError("the frame is not a JPEG image")
        return np.asarray(image, np.uint8)
