"""The serial line from a simulated sensor to the host."""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

GARBLED = bytes((157 * byte + 91) % 256 for byte in range(256))  # what a wrong baud rate makes of a byte


class SimulatedSensor(Protocol):
    """A sensor on a serial line of its own. The caller owns the clock."""

    @property
    def baud(self) -> int:
        """Its baud rate; 0 if any will do, as on USB."""
        ...

    def write(self, data: bytes, time_s: float) -> None:
        """Receive bytes from the host."""
        ...

    def advance(self, time_s: float) -> None:
        """Advance time and send what ends by then."""
        ...

    def read(self) -> bytes:
        """Return the bytes that have reached the host."""
        ...


@runtime_checkable
class HasMotor(Protocol):
    """A lidar whose adapter switches its motor."""

    def set_dtr(self, level: bool, time_s: float) -> None:
        """Set the line DTR, which runs the motor of some models."""
        ...

    def power_off(self) -> None:
        """Stop: the plug is out."""
        ...


class SensorLine:
    """A sensor, its plug, and its bytes that wait at the host."""

    def __init__(self, sensor: SimulatedSensor, is_plugged: Callable[[], bool]) -> None:
        """`is_plugged()` says whether the USB plug is in: without it, bytes are lost both ways."""
        self._sensor, self._is_plugged = sensor, is_plugged
        self._motor = sensor if isinstance(sensor, HasMotor) else None
        self._waiting = bytearray()
        self.host_baud = 0  # 0: unknown

    def advance(self, time_s: float) -> None:
        """Advance the sensor's time; without the plug, it has no power for a motor."""
        if self._motor is not None and not self._is_plugged():
            self._motor.power_off()
        self._sensor.advance(time_s)

    def set_dtr(self, level: bool, time_s: float) -> None:
        """Set the line DTR of the sensor's adapter, which runs the motor of some lidars."""
        if self._motor is not None:
            self._motor.set_dtr(level, time_s)

    def write(self, data: bytes, time_s: float) -> None:
        """Send bytes to the sensor."""
        if self._is_plugged() and self._is_understood:
            self._sensor.write(data, time_s)

    def available(self, time_s: float) -> int:
        """Return the number of bytes that wait to be read."""
        self._sensor.advance(time_s)
        sent = self._sensor.read()
        if self._is_plugged():
            self._waiting += sent if self._is_understood else sent.translate(GARBLED)
        return len(self._waiting)

    def read(self, limit: int, time_s: float) -> bytes:
        """Return up to `limit` bytes from the sensor."""
        self.available(time_s)
        data = bytes(self._waiting[:limit])
        del self._waiting[:limit]
        return data

    def clear(self, time_s: float) -> None:
        """Lose what the sensor has sent so far."""
        self.available(time_s)
        self._waiting.clear()

    @property
    def _is_understood(self) -> bool:
        rates = {self._sensor.baud, self.host_baud}
        return 0 in rates or len(rates) == 1
