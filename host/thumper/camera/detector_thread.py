"""Runs the detector in a thread of its own: it takes longer than a control cycle."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager

from thumper.camera.detector import Detection, open_detector
from thumper.camera.frame import CameraFrame
from thumper.camera.options import CameraOptions

FindObjects = Callable[[CameraFrame], Future[list[Detection]]]
"""Starts to look for objects in a frame."""


@contextmanager
def detector_thread(options: CameraOptions) -> Iterator[FindObjects]:
    """Load the detector and start its thread, which ends after the frame that it works on.

    Raises
    ------
    ThumperError
        The extra is not installed, or the file is missing or wrong.
    """
    detector = open_detector(options)
    with ThreadPoolExecutor(1, "objects") as thread:
        yield lambda frame: thread.submit(detector.find, frame)
