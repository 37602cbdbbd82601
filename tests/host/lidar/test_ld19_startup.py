"""Errors of the LD19 driver without a lidar, or with another device, on the port."""

from typing import cast

import pytest
import serial

from tests.host.lidar.test_ld19_protocol import PUBLISHED
from thumper.common.errors import ThumperError
from thumper.common.serial_port import SerialPort
from thumper.lidar.ld19 import Ld19Driver


class OneWayPort:
    """Returns the same bytes at every read; its clock runs while the host waits."""

    port = "/dev/ttyUSB7"
    baudrate = 115_200

    def __init__(self, sends: bytes, *, fails: bool = False) -> None:
        self._sends = sends
        self._fails = fails
        self.timeout = 0.02
        self.time_s = 100.0

    def clock_s(self) -> float:
        return self.time_s

    @property
    def in_waiting(self) -> int:
        if self._fails:
            raise OSError("input/output error")  # as from an unplugged device; pyserial does not wrap it
        return len(self._sends)

    def read(self, size: int) -> bytes:
        self.time_s += self.timeout
        return self._sends[:size]


@pytest.mark.parametrize(
    ("port", "message"),
    [
        (OneWayPort(b""), "no data from the lidar"),
        (OneWayPort(b"MD0044072501000\n99b\n"), "not an LD19 at 115200 baud .an LD19 needs 230400"),
        (OneWayPort(b"", fails=True), "cable loose"),
    ],
)
def test_a_failed_start_is_one_line_that_names_the_port(port: OneWayPort, message: str) -> None:
    with pytest.raises(ThumperError, match=message) as caught:
        Ld19Driver(SerialPort(cast("serial.Serial", port)))
    assert caught.value.exit_code == 3
    assert "/dev/ttyUSB7" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert port.time_s < 105.0


def test_one_frame_is_enough_to_start() -> None:
    Ld19Driver(SerialPort(cast("serial.Serial", OneWayPort(PUBLISHED))))
