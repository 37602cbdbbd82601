"""Open the configured gyroscope with the driver of its model."""

from thumper.common.sensor import Sensor
from thumper.common.serial_port import open_port
from thumper.imu.bno08x import BAUD, Bno08xDriver
from thumper.imu.options import ImuOptions
from thumper.imu.sample import ImuSample


def open_imu(options: ImuOptions) -> Sensor[ImuSample]:
    """Open the port and wait for the gyroscope on it.

    Raises
    ------
    ThumperError
        The port cannot be opened, or has no such gyroscope; the message says how to fix it.
    """
    port = open_port(options.port, baud=BAUD, name="imu")
    try:
        return Bno08xDriver(port)
    except BaseException:
        port.close()
        raise
