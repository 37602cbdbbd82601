"""Open the lidar that a configuration names, with the driver of its model."""

from thumper.config.robot import LidarConfig
from thumper.lidar import ld19, urg04lx
from thumper.lidar.driver import LidarDriver


def open_lidar(config: LidarConfig) -> LidarDriver:
    """Open the port and wake the lidar on it.

    Raises
    ------
    ThumperError
        The port cannot be opened, or no lidar of that model is on it; the message names the cure.
    """
    if config.model == "ld19":
        return ld19.Ld19Driver.open(config.port, baud=config.baud or ld19.BAUD, options=config.ld19)
    return urg04lx.Urg04LxDriver.open(config.port, baud=config.baud or urg04lx.BAUD, options=config.urg04lx)
