"""Driver of the Hokuyo URG-04LX and its kin: scans over SCIP 2.0, stamped on the host's clock."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import serial
from annotated_types import Ge, Le

from thumper.common.closable import Closable
from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.common.geometry import FloatArray
from thumper.common.serial_port import port_clock
from thumper.lidar.clock import ClockSync
from thumper.lidar.driver import LidarCounters
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

BAUD = 115_200  # for units with a serial line; USB ones ignore it
CODES_BELOW_MM = 20
NO_RETURN = 0
SILENCE_S = 1.0
"""A stream that has been silent for so long is ordered again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Urg04LxOptions:
    """What may be set of the driver."""

    # Take code 0 as "nothing seen" (+inf) instead of invalid. Dark and shiny things read 0 too: with this on,
    # free space is drawn through them.
    zero_as_no_return: bool = False
    # The step at which the lidar takes its stamp [step]: 0 by the protocol's text, -128 (behind) by others.
    stamp_step: Annotated[int, Ge(-512), Le(1023)] = 0


class Urg04LxDriver(Closable):
    """A lidar that streams. The constructor wakes it, which takes a second or two; `poll` never waits."""

    def __init__(
        self,
        port: serial.Serial,
        *,
        clock_s: Callable[[], float] | None = None,
        options: Urg04LxOptions | None = None,
        name: str = "",
    ) -> None:
        """Wake the lidar on `port` and start the stream; `name` is what errors call the port.

        Raises
        ------
        ThumperError
            No lidar answers, or what answers is none (exit code 3).
        """
        self._options = options or Urg04LxOptions()
        self._name = name or str(port.port)
        self._port = ScipPort(port, clock_s or port_clock(port))
        self.counters = LidarCounters()
        try:
            self.identity = stop_and_identify(self._port, self._name)
            self.geometry = read_geometry(self._port, self._name)
            last_beam_s = (self.geometry.last_step - self._options.stamp_step) * self.geometry.step_s
            self._stamps = ClockSync(wrap_ms=CLOCK_WRAP_MS, least_lag_s=last_beam_s)
            sync_clock(self._port, self._stamps)
            enable_laser(self._port, self._name)
            self._request = stream_request(self.geometry.first_step, self.geometry.last_step)
            self._port.send(self._request)
        except (serial.SerialException, OSError) as error:  # in_waiting of a pulled plug is a plain OSError
            raise ThumperError(
                f"the lidar's port {self._name} fails ({error}); is the cable loose?",
                exit_code=EXIT_NOT_THERE,
            ) from error
        self._last_scan_s = self._port.now_s()

    def poll(self) -> list[Scan]:
        """Return the scans that have arrived since the last call, oldest first. Never waits, never raises."""
        return self._receive(self._port.take)

    def wait_for_scan(self, timeout_s: float) -> Scan:
        """Wait for the next scan.

        Raises
        ------
        ThumperError
            None comes in time.
        """
        until_s = self._port.now_s() + timeout_s
        while self._port.now_s() < until_s:
            if scans := self._receive(self._port.wait):
                return scans[-1]
        raise ThumperError(
            f"the lidar on {self._name} answers but sends no scan; does its head turn? is its supply weak?",
            exit_code=EXIT_NOT_THERE,
        )

    def now_s(self) -> float:
        """The clock that the scans are stamped on."""
        return self._port.now_s()

    def round_trip_s(self, question: int, timeout_s: float) -> float | None:
        """Ask for the state and return how long [s] the answer took, None if none came in time; costs a scan.

        The question's number goes along as its remark, so that a late answer is not taken for the next one's.
        """
        asked_s = self._port.now_s()
        try:
            reply = self._port.ask(b"II;%02d" % (question % 100), timeout_s)
        except (serial.SerialException, OSError):
            self.counters.port_errors += 1
            return None
        return None if reply is None else self._port.now_s() - asked_s

    def close(self) -> None:
        """Switch the laser off and close the port; a port that has gone is no error."""
        try:
            self._port.send(b"QT\n")
        except (serial.SerialException, OSError):
            self.counters.port_errors += 1
        self._port.close()

    def _receive(self, replies: Callable[[], list[bytes]]) -> list[Scan]:
        try:
            raws = replies()
        except (serial.SerialException, OSError):
            self.counters.port_errors += 1
            raws = []
        now_s = self._port.now_s()
        scans = [scan for raw in raws if (scan := self._decode(raw, now_s)) is not None]
        if scans:
            self.counters.scans += len(scans)
            self._last_scan_s = now_s
        elif now_s - self._last_scan_s > SILENCE_S:
            self._restart(now_s)
        return scans

    def _restart(self, now_s: float) -> None:
        self.counters.restarts += 1
        self._last_scan_s = now_s  # give it as long again
        self._port.forget()
        try:
            self._port.send(b"QT\nBM\n" + self._request)
        except (serial.SerialException, OSError):
            self.counters.port_errors += 1

    def _decode(self, raw: bytes, received_s: float) -> Scan | None:
        # A reply cut off runs into the next one; the last echo in it begins the one that may be whole.
        start = max(raw.rfind(self._request[:10]), 0)
        try:
            reply = parse_reply(raw[start:])
            if not reply.echo.startswith("MD") or reply.status == STATUS_OK:
                return None  # the answer to something else
            if reply.status != STATUS_SCAN:
                raise ScipError(f"status {reply.status}")
            scan = parse_scan(reply)
            if scan.values_mm.size != self.geometry.beams:
                raise ScipError(f"{scan.values_mm.size} beams")
        except ScipError:
            self.counters.bad_replies += 1
            return None
        step_rad = 2.0 * np.pi / self.geometry.steps_per_revolution
        stamped_s = self._stamps.host_time_s(scan.stamp_ms, received_s)
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
