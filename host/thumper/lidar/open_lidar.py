"""Open the configured lidar with the driver of its model."""

from thumper.common.serial_port import open_port
from thumper.lidar import ld19, urg04lx
from thumper.lidar.a5_lidar import A5Lidar
from thumper.lidar.a5_models import A5_MODELS
from thumper.lidar.driver import LidarDriver
from thumper.lidar.options import LidarOptions
from thumper.lidar.upside_down import UpsideDownLidar


def open_lidar(config: LidarOptions) -> LidarDriver:
    """Open the port and start the lidar on it.

    Raises
    ------
    ThumperError
        The port cannot be opened, or has no lidar of that model; the message says how to fix it.
    """
    a5_model = A5_MODELS.get(config.model)
    default_baud = ld19.BAUD if config.model == "ld19" else urg04lx.BAUD
    baud = config.baud or (a5_model.baud if a5_model else default_baud)
    port = open_port(config.port, baud=baud, name="lidar")
    try:
        driver: LidarDriver
        if a5_model:
            driver = A5Lidar(port, model=a5_model, options=config.rplidar)
        elif config.model == "ld19":
            driver = ld19.Ld19Driver(port, options=config.ld19)
        else:
            driver = urg04lx.Urg04LxDriver(port, options=config.urg04lx)
        return UpsideDownLidar(driver) if config.upside_down else driver
    except BaseException:
        port.close()
        raise
