"""Open the configured GPS receiver."""

from thumper.common.sensor import Sensor
from thumper.common.serial_port import open_port
from thumper.gps.fix import Fix
from thumper.gps.options import GpsOptions


def open_gps(options: GpsOptions) -> Sensor[Fix]:
    """Open the port and wait for the receiver on it; it may not have a fix yet.

    Raises
    ------
    ThumperError
        The port cannot be opened, or sends neither NMEA nor UBX; the message says how to fix it.
    """
    from thumper.gps.driver import GpsDriver  # NMEA takes 30 ms to load; most robots have no receiver

    port = open_port(options.port, baud=options.baud, name="gps")
    try:
        return GpsDriver(port, latency_s=options.latency_s)
    except BaseException:
        port.close()
        raise
