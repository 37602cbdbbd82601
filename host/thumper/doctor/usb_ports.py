"""The computer's USB serial ports, and what is known to be behind them."""

from dataclasses import dataclass

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
