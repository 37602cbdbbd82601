"""Open the configured camera."""

from thumper.camera.frame import CameraFrame
from thumper.camera.mjpeg import MjpegDriver
from thumper.camera.options import CameraOptions
from thumper.camera.v4l2 import V4l2Camera, open_v4l2
from thumper.common.optional_packages import require_extra
from thumper.common.sensor import Sensor
from thumper.common.serial_port import open_port


def open_camera(options: CameraOptions) -> Sensor[CameraFrame]:
    """Open the camera and wait for its first frame.

    Raises
    ------
    ThumperError
        OpenCV is not installed, there is no camera, or it sends nothing; the message says how to fix it.
    """
    require_extra("camera")
    if "://" not in options.port:
        return V4l2Camera(open_v4l2(options), name=options.port, latency_s=options.latency_s)
    port = open_port(options.port, baud=115_200, name="camera")
    try:
        camera = MjpegDriver(port, latency_s=options.latency_s)
        options.check_shape(camera.shape)
    except BaseException:
        port.close()
        raise
    return camera
