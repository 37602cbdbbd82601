"""Open the lidar that a configuration names, with the driver of its model."""

from thumper.common.serial_port import open_port
from thumper.lidar import ld19, urg04lx
from thumper.lidar.driver import LidarDriver
from thumper.lidar.options import LidarOptions


def open_lidar(config: LidarOptions) -> LidarDriver:
    """Open the port and wake the lidar on it.

    Raises
    ------
    ThumperError
        The port cannot be opened, or no lidar of that model is on it; the message names the cure.
    """
    baud = config.baud or (ld19.BAUD if config.model == "ld19" else urg04lx.BAUD)
    port = open_port(config.port, baud=baud, name="lidar")
    try:
        if config.model == "ld19":
            return ld19.Ld19Driver(port, options=config.ld19, name=config.port)
        return urg04lx.Urg04LxDriver(port, options=config.urg04lx, name=config.port)
    except BaseException:
        port.close()
        raise
