"""Driver of the Hokuyo URG-04LX and compatible lidars: SCIP 2.0 scans, stamped on the host's clock."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from thumper.common.closable import Closable
from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.common.geometry import FloatArray
from thumper.common.sensor import SensorCounters
from thumper.common.serial_port import PortError, SerialPort
from thumper.lidar.clock import ClockSync
from thumper.lidar.scan import Scan
from thumper.lidar.scip import (
    CLOCK_WRAP_MS,
    STATUS_OK,
    STATUS_SCAN,
    RangeArray,
    ScipError,
    parse_reply,
    parse_scan,
    stream_request,
)
from thumper.lidar.scip_port import ScipPort
from thumper.lidar.scip_startup import enable_laser, read_geometry, stop_and_identify, sync_clock

BAUD = 115_200  # for units with a serial line; USB units ignore it
CODES_BELOW_MM = 20
NO_RETURN = 0
SILENCE_S = 1.0
"""Request the stream again after this time without a scan."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Urg04LxOptions:
    """Options of the driver."""

    # Read code 0 as "no return" (+inf) instead of invalid. Dark and shiny surfaces read 0, too: this option
    # maps them as free space.
    zero_as_no_return: bool = False
    # The step at which the lidar takes its stamp [step]. The protocol document says 0; if a calibration shows
    # that it is behind the robot, set -128.
    stamp_step: Annotated[int, Ge(-512), Le(1023)] = 0


class Urg04LxDriver(Closable):
    """A streaming lidar. The constructor takes a second or two to start it; `poll` never waits."""

    def __init__(self, port: SerialPort, *, options: Urg04LxOptions | None = None) -> None:
        """Start the lidar on `port` and its scan stream.

        Raises
        ------
        ThumperError
            No lidar answers, or the device is not a lidar (exit code 3).
        """
        self._options = options or Urg04LxOptions()
        self._port = ScipPort(port)
        self.counters = SensorCounters()
        self.identity = stop_and_identify(self._port)
        self.geometry = read_geometry(self._port)
        last_beam_s = (self.geometry.last_step - self._options.stamp_step) * self.geometry.step_s
        self._clock_sync = ClockSync(wrap_ms=CLOCK_WRAP_MS, least_lag_s=last_beam_s)
        sync_clock(self._port, self._clock_sync)
        enable_laser(self._port)
        self._request = stream_request(self.geometry.first_step, self.geometry.last_step)
        self._port.send(self._request)
        self._last_scan_s = self._port.now_s()

    def poll(self) -> list[Scan]:
        """Return the scans that have arrived since the last call, oldest first. Never waits, never raises."""
        return self._receive(self._port.poll)

    def wait_for_sample(self, timeout_s: float) -> Scan:
        """Wait for the next scan.

        Raises
        ------
        ThumperError
            No scan arrives in time.
        """
        until_s = self._port.now_s() + timeout_s
        while self._port.now_s() < until_s:
            if scans := self._receive(self._port.wait):
                return scans[-1]
        raise ThumperError(
            f"the lidar on {self._port.url} answers but sends no scan; "
            "check that its head turns and its supply is sufficient",
            exit_code=EXIT_NOT_THERE,
        )

    def now_s(self) -> float:
        """Return the time [s] on the clock of the scan stamps."""
        return self._port.now_s()

    def round_trip_s(self, number: int, timeout_s: float) -> float | None:
        """Request the state; return how long [s] the reply took, or None if none came. Costs a scan.

        The request carries its `number` as a remark, so that a late reply is not mistaken for the reply to
        the next request.
        """
        sent_s = self._port.now_s()
        try:
            reply = self._port.request(b"II;%02d" % (number % 100), timeout_s)
        except PortError:
            self.counters.port_errors += 1
            return None
        return None if reply is None else self._port.now_s() - sent_s

    def close(self) -> None:
        """Switch the laser off and close the port, even if the device is gone."""
        try:
            self._port.send(b"QT\n")
        except PortError:
            self.counters.port_errors += 1
        self._port.close()

    def _receive(self, read: Callable[[], list[bytes]]) -> list[Scan]:
        try:
            raws = read()
        except PortError:
            self.counters.port_errors += 1
            raws = []
        now_s = self._port.now_s()
        scans = [scan for raw in raws if (scan := self._decode(raw, now_s)) is not None]
        if scans:
            self.counters.samples += len(scans)
            self._last_scan_s = now_s
        elif now_s - self._last_scan_s > SILENCE_S:
            self._restart(now_s)
        return scans

    def _restart(self, now_s: float) -> None:
        self.counters.restarts += 1
        self._last_scan_s = now_s  # wait as long again
        self._port.drop_partial_reply()
        try:
            self._port.send(b"QT\nBM\n" + self._request)
        except PortError:
            self.counters.port_errors += 1

    def _decode(self, raw: bytes, received_s: float) -> Scan | None:
        # A truncated reply runs into the next one; the last echo starts the one that may be complete.
        start = max(raw.rfind(self._request[:10]), 0)
        try:
            reply = parse_reply(raw[start:])
            if not reply.echo.startswith("MD") or reply.status == STATUS_OK:
                return None  # the reply to another request
            if reply.status != STATUS_SCAN:
                raise ScipError(f"status {reply.status}")
            scan = parse_scan(reply)
            if scan.values_mm.size != self.geometry.beams:
                raise ScipError(f"{scan.values_mm.size} beams")
        except ScipError:
            self.counters.bad_replies += 1
            return None
        step_rad = 2.0 * np.pi / self.geometry.steps_per_revolution
        stamped_s = self._clock_sync.host_time_s(scan.stamp_ms, received_s)
        return Scan(
            time_s=stamped_s + (self.geometry.first_step - self._options.stamp_step) * self.geometry.step_s,
            ranges_m=self._ranges_m(scan.values_mm),
            angle_min_rad=(self.geometry.first_step - self.geometry.front_step) * step_rad,
            angle_increment_rad=step_rad,
            time_increment_s=self.geometry.step_s,
            range_min_m=1e-3 * CODES_BELOW_MM,
            range_max_m=self.geometry.range_max_m,
        )

    def _ranges_m(self, values_mm: RangeArray) -> FloatArray:
        ranges_m = np.where(values_mm >= CODES_BELOW_MM, 1e-3 * values_mm, np.nan)
        if self._options.zero_as_no_return:
            ranges_m[values_mm == NO_RETURN] = np.inf
        return ranges_m
