"""The interface of all sensors on a port of their own, and the parts that their drivers share."""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Generic, Protocol, TypeVar

from thumper.common.closable import Closable
from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.common.serial_port import PortError, SerialPort

Sample = TypeVar("Sample")

READ_TIMEOUT_S = 0.02
GONE_ERRORS = 5  # port errors in succession, without a sample between them: the port has gone
RETRY_S = 1.0  # opening a sensor that answers takes up to 3 s


@dataclass(slots=True, kw_only=True)
class SensorCounters:
    """Events on the line since the start."""

    samples: int = 0
    bad_replies: int = 0  # replies or frames that fail their checksum
    restarts: int = 0
    port_errors: int = 0


class Sensor(Protocol[Sample]):
    """A streaming sensor. Its constructor starts it; `poll` never waits and never raises."""

    @property
    def counters(self) -> SensorCounters:
        """Events on the line since the start."""
        ...

    def poll(self) -> list[Sample]:
        """Return the samples that have arrived since the last call, oldest first."""
        ...

    def wait_for_sample(self, timeout_s: float) -> Sample:
        """Wait for the next sample; raise `ThumperError` if none arrives in time."""
        ...

    def now_s(self) -> float:
        """Return the time [s] on the clock of the samples' stamps."""
        ...

    def close(self) -> None:
        """Close the port, even if the device is gone."""
        ...


class StreamSensor(Closable, Generic[Sample]):
    """A sensor that only sends: a driver decodes the bytes."""

    NAME = "sensor"  # in messages
    SILENT = "check its supply and its cable"  # what to do if it sends nothing

    def __init__(self, port: SerialPort) -> None:
        self._port = port
        self.counters = SensorCounters()

    @abstractmethod
    def _decode(self, data: bytes, now_s: float) -> list[Sample]:
        """Return the samples that end in these bytes, which arrived by `now_s`; count what is damaged."""

    def poll(self) -> list[Sample]:
        """Return the samples that have arrived since the last call, oldest first. Never waits or raises."""
        return self._receive()

    def wait_for_sample(self, timeout_s: float) -> Sample:
        """Wait for the next sample.

        Raises
        ------
        ThumperError
            None arrives in time.
        """
        until_s = self.now_s() + timeout_s
        while self.now_s() < until_s:
            if samples := self._receive(READ_TIMEOUT_S):
                return samples[-1]
        raise ThumperError(
            f"the {self.NAME} on {self._port.url} has stopped sending; {self.SILENT}",
            exit_code=EXIT_NOT_THERE,
        )

    def now_s(self) -> float:
        """Return the time [s] on the clock of the samples' stamps."""
        return self._port.now_s()

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    def _start(self, timeout_s: float, recognizes: Callable[[bytes], bool], *, foreign: str) -> None:
        """Read until `recognizes` accepts some bytes.

        Raises
        ------
        ThumperError
            No data arrives, or none that it accepts: `foreign` says what is on the port instead.
        """
        received = 0
        until_s = self.now_s() + timeout_s
        while self.now_s() < until_s:
            data = self._port.read_available(READ_TIMEOUT_S)
            received += len(data)
            if recognizes(data):
                return
        silent = f"no data from the {self.NAME} on {self._port.url}; {self.SILENT}"
        raise ThumperError(foreign if received else silent, exit_code=EXIT_NOT_THERE)

    def _receive(self, timeout_s: float | None = None) -> list[Sample]:
        try:
            data = self._port.read_available(timeout_s)
        except PortError:
            self.counters.port_errors += 1
            return []
        samples = self._decode(data, self.now_s())
        self.counters.samples += len(samples)
        return samples


class ReopenedSensor(Generic[Sample]):
    """A sensor of a running robot, which is opened again after its port has gone."""

    def __init__(
        self, name: str, sensor: Sensor[Sample], open_again: Callable[[], Sensor[Sample]] | None = None
    ) -> None:
        self.name = name
        self.device = sensor
        self._open = open_again
        self._errors_seen = 0  # the count at the newest sample
        self._next_open_s = 0.0

    @property
    def counters(self) -> SensorCounters:
        """Events on the line since the start of the run."""
        return self.device.counters

    def poll(self) -> list[Sample]:
        """Return the samples that have arrived since the last call, oldest first. Never waits or raises."""
        samples = self.device.poll()
        if samples:
            self._errors_seen = self.counters.port_errors
        return samples

    @property
    def is_gone(self) -> bool:
        """Whether its port has gone."""
        return self.counters.port_errors - self._errors_seen >= GONE_ERRORS

    def reopen(self, now_s: float) -> bool:
        """Open the sensor again if its port has gone; return whether it answers again.

        May block for seconds: call it only while the robot is stationary.
        """
        if not self.is_gone or self._open is None or now_s < self._next_open_s:
            return False
        self._next_open_s = now_s + RETRY_S
        before = self.counters
        self.device.close()  # or its device name stays in use
        try:
            self.device = self._open()
        except ThumperError:
            return False
        for counter in fields(before):  # they count from the start of the run
            total = getattr(before, counter.name) + getattr(self.counters, counter.name)
            setattr(self.counters, counter.name, total)
        self.counters.restarts += 1
        self._errors_seen = self.counters.port_errors
        return True

    def close(self) -> None:
        """Close the port, even if the device is gone."""
        self.device.close()
