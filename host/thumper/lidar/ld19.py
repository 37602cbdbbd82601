"""Driver of the LDROBOT LD19 (and LD06): it talks from power-on and cannot be asked anything."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import serial
from annotated_types import Ge, Le

from thumper.common.closable import Closable
from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.common.serial_port import port_clock
from thumper.lidar.clock import ClockSync
from thumper.lidar.driver import LidarCounters
from thumper.lidar.ld19_protocol import (
    FRAME_BYTES,
    STAMP_WRAP_MS,
    Ld19Decoder,
    Ld19Frame,
    Revolution,
    RevolutionAssembler,
)
from thumper.lidar.scan import Scan

BAUD = 230_400
POINT_S = 1.0 / 4500.0
RANGE_MIN_M, RANGE_MAX_M = 0.02, 12.0
WIRE_S = 10.0 * FRAME_BYTES / BAUD
"""A frame is on the wire for 2 ms: it is never younger when it is read."""

START_TIMEOUT_S = 4.0  # the head needs up to 3 s to come up to speed
READ_TIMEOUT_S = 0.02
STAMP_GRAIN_S = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Ld19Options:
    """What may be set of the driver."""

    # Take a distance of 0 as "nothing seen" (+inf) instead of invalid, as for the URG-04LX.
    zero_as_no_return: bool = False
    # Points with a weaker echo are invalid [0 ... 255].
    min_intensity: Annotated[int, Ge(0), Le(255)] = 0


class Ld19Driver(Closable):
    """A lidar that streams. The constructor waits for its first frame; `poll` never waits."""

    def __init__(
        self,
        port: serial.Serial,
        *,
        clock_s: Callable[[], float] | None = None,
        options: Ld19Options | None = None,
        name: str = "",
    ) -> None:
        """Listen on `port` until a frame has come; `name` is what errors call the port.

        Raises
        ------
        ThumperError
            Nothing comes, or what comes is from no LD19 (exit code 3).
        """
        self._options = options or Ld19Options()
        self._name = name or str(port.port)
        self._port = port
        self._clock_s = clock_s or port_clock(port)
        self._decoder = Ld19Decoder()
        self._assembler = RevolutionAssembler()
        # The stamp is taken to be that of the frame's last point, after which the frame is sent.
        self._stamps = ClockSync(wrap_ms=STAMP_WRAP_MS, least_lag_s=WIRE_S)
        self.counters = LidarCounters()
        port.timeout = READ_TIMEOUT_S
        self._wait_for_frame()

    def poll(self) -> list[Scan]:
        """Return the scans that have arrived since the last call, oldest first. Never waits, never raises."""
        return self._receive(waits=False)

    def wait_for_scan(self, timeout_s: float) -> Scan:
        """Wait for the next scan.

        Raises
        ------
        ThumperError
            None comes in time.
        """
        until_s = self._clock_s() + timeout_s
        while self._clock_s() < until_s:
            if scans := self._receive(waits=True):
                return scans[-1]
        raise ThumperError(
            f"the lidar on {self._name} has stopped to send turns; is its head free and its supply 5 V?",
            exit_code=EXIT_NOT_THERE,
        )

    def now_s(self) -> float:
        """The clock that the scans are stamped on."""
        return self._clock_s()

    def close(self) -> None:
        """Close the port; the lidar turns on, as nothing can stop it."""
        self._port.close()

    def _wait_for_frame(self) -> None:
        received_bytes = 0
        until_s = self._clock_s() + START_TIMEOUT_S
        while self._clock_s() < until_s:
            try:
                data = self._read(waits=True)
            except (serial.SerialException, OSError) as error:
                raise ThumperError(
                    f"the lidar's port {self._name} fails ({error}); is the cable loose?",
                    exit_code=EXIT_NOT_THERE,
                ) from error
            received_bytes += len(data)
            if self._decoder.feed(data):
                return
        if received_bytes == 0:
            raise ThumperError(
                f"nothing comes from the lidar on {self._name}; is it powered (5 V), does its head turn, "
                "and is its TX wire on the adapter's RX?",
                exit_code=EXIT_NOT_THERE,
            )
        raise ThumperError(
            f"what is on {self._name} is no LD19 at {self._port.baudrate} baud; it needs {BAUD}: correct "
            "[lidar] port, model and baud",
            exit_code=EXIT_NOT_THERE,
        )

    def _read(self, *, waits: bool) -> bytes:
        waiting = self._port.in_waiting
        return self._port.read(max(1, waiting) if waits else waiting)

    def _receive(self, *, waits: bool) -> list[Scan]:
        try:
            data = self._read(waits=waits)
        except (serial.SerialException, OSError):
            self.counters.port_errors += 1
            return []
        now_s = self._clock_s()
        revolutions = [self._add(frame, now_s) for frame in self._decoder.feed(data)]
        scans = [self._scan(one) for one in revolutions if one is not None]
        self.counters.scans += len(scans)
        self.counters.bad_replies = self._decoder.bad_frames
        return scans

    def _add(self, frame: Ld19Frame, received_s: float) -> Revolution | None:
        # A stamp is cut down to whole milliseconds: on average it is half a one early. The smallest lag is
        # that of a stamp hardly cut, so that half a millisecond is added to the mean, none to the least.
        stamped_s = self._stamps.host_time_s(frame.stamp_ms, received_s)
        return self._assembler.feed(frame, stamped_s + 0.5 * STAMP_GRAIN_S, POINT_S)

    def _scan(self, revolution: Revolution) -> Scan:
        no_return_m = np.inf if self._options.zero_as_no_return else np.nan
        ranges_m = np.where(revolution.ranges_mm == 0, no_return_m, 1e-3 * revolution.ranges_mm)
        ranges_m[revolution.intensities < self._options.min_intensity] = np.nan
        ranges_m[~revolution.known] = np.nan
        return Scan(
            time_s=revolution.time_s,
            ranges_m=np.asarray(ranges_m, np.float64),
            angle_min_rad=-np.deg2rad(revolution.first_deg) + 2.0 * np.pi,
            angle_increment_rad=-np.deg2rad(revolution.step_deg),
            time_increment_s=revolution.point_s,
            range_min_m=RANGE_MIN_M,
            range_max_m=RANGE_MAX_M,
        )
