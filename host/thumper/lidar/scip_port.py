"""Questions and answers with a SCIP 2.0 device on a serial port. Only `ask` and `wait` wait."""

from collections.abc import Callable

import serial

from thumper.lidar.scip import Reply, ReplySplitter, ScipError, parse_reply

READ_TIMEOUT_S = 0.02


class ScipPort:
    """A port, its clock, and the replies that come through it."""

    def __init__(self, port: serial.Serial, clock_s: Callable[[], float]) -> None:
        self._port = port
        self._clock_s = clock_s
        self._splitter = ReplySplitter()
        self.received_bytes = 0
        port.timeout = READ_TIMEOUT_S

    def now_s(self) -> float:
        """The time of the world that the port lives in."""
        return self._clock_s()

    def send(self, lines: bytes) -> None:
        """Write requests; the first line feed ends whatever half a line the device may hold."""
        self._port.write(b"\n" + lines)

    def take(self) -> list[bytes]:
        """Return the replies that are complete by now, without waiting."""
        return self._feed(self._port.read(self._port.in_waiting))

    def wait(self) -> list[bytes]:
        """Return the replies that are complete after a short wait for at least one byte."""
        return self._feed(self._port.read(max(1, self._port.in_waiting)))

    def ask(self, command: bytes, timeout_s: float) -> Reply | None:
        """Send one request and return the reply that echoes it, None if there is none in time.

        Other replies are thrown away: a stream may still be running.
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

    def forget(self) -> None:
        """Drop a reply that has begun."""
        self._splitter.clear()

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    def _feed(self, data: bytes) -> list[bytes]:
        self.received_bytes += len(data)
        return self._splitter.feed(data)
