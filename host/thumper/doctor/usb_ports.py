"""The computer's USB serial ports, and what is known to be behind them."""

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass

PSEUDO_TERMINAL = re.compile(r"/dev/(pts/|ttys)\d+")  # of Linux and of macOS, as `thumper sim` opens them
LIDAR_ID = (0x15D1, 0x0000)
KNOWN_USB = {
    LIDAR_ID: "Hokuyo lidar",
    (0x10C4, 0xEA60): "CP210x (T'REX board, or adapter of a lidar)",
    (0x1A86, 0x7523): "CH340 (Nano clone, or adapter of a lidar)",
    (0x0403, 0x6001): "FTDI (Nano)",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class UsbPort:
    """One serial port; `is_lidar` if its USB id belongs to a lidar."""

    device: str
    name: str
    is_lidar: bool


def usb_ports() -> list[UsbPort]:
    """Return the ports that are plugged in now."""
    from serial.tools.list_ports import comports

    found = [((port.vid, port.pid), port) for port in comports() if port.vid is not None]
    return [
        UsbPort(device=port.device, name=KNOWN_USB.get(usb, port.description), is_lidar=usb == LIDAR_ID)
        for usb, port in found
    ]


def all_simulated(ports: Iterable[str]) -> bool:
    """Return whether every port is simulated in this program or by `thumper sim`."""
    return all(port.startswith("sim:") or PSEUDO_TERMINAL.fullmatch(os.path.realpath(port)) for port in ports)
