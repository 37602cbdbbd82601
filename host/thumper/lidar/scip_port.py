"""Requests to a SCIP 2.0 device on a serial port, and its replies. Only `request` and `wait` block."""

from thumper.common.serial_port import SerialPort
from thumper.lidar.scip import Reply, ReplySplitter, ScipError, parse_reply

READ_TIMEOUT_S = 0.02


class ScipPort:
    """A serial port that is read reply by reply. Every method may raise `PortError`."""

    def __init__(self, port: SerialPort) -> None:
        self._port = port
        self._splitter = ReplySplitter()
        self.received_bytes = 0

    @property
    def url(self) -> str:
        """URL of the port, for error messages."""
        return self._port.url

    def now_s(self) -> float:
        """Return the time [s] on the clock of the port."""
        return self._port.now_s()

    def send(self, lines: bytes) -> None:
        """Write requests. The leading line feed ends a partial line that the device may hold."""
        self._port.write(b"\n" + lines)

    def poll(self) -> list[bytes]:
        """Return the replies that are complete by now, without waiting."""
        return self._feed(self._port.read_available())

    def wait(self) -> list[bytes]:
        """Return the replies that are complete after a short wait for at least one byte."""
        return self._feed(self._port.read_available(READ_TIMEOUT_S))

    def request(self, command: bytes, timeout_s: float) -> Reply | None:
        """Send one request; return the reply that echoes it, or None if there is none in time.

        Drops all other replies, because a stream may still be running.
        """
        self.send(command + b"\n")
        until_s = self.now_s() + timeout_s
        while self.now_s() < until_s:
            for raw in self.wait():
                start = raw.rfind(command)
                if start < 0:
                    continue
                try:
                    return parse_reply(raw[start:])
                except ScipError:
                    continue
        return None

    def drop_partial_reply(self) -> None:
        """Drop an incomplete reply."""
        self._splitter.clear()

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    def _feed(self, data: bytes) -> list[bytes]:
        self.received_bytes += len(data)
        return self._splitter.feed(data)
