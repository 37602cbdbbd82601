"""Lidars: one `Scan` type, one driver a sensor."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from thumper.lidar.urg04lx import Urg04LxDriver


def open_lidar(url: str, *, baud: int) -> "Urg04LxDriver":
    """Open the lidar at `url`; see `Urg04LxDriver.open`."""
    from thumper.lidar.urg04lx import Urg04LxDriver  # those who only want `Scan` need no serial port

    return Urg04LxDriver.open(url, baud=baud)
