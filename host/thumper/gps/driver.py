"""Driver of GPS receivers that send NMEA 0183 or u-blox's UBX, whichever arrives.

A receiver sends a burst per epoch. The accuracy follows the position: GST or NAV-COV. Once NAV-PVT has
arrived, NMEA is checked and ignored, since both report the same positions.
"""

import math
from collections.abc import Callable
from datetime import time
from typing import Any

from thumper.common.sensor import StreamSensor
from thumper.common.serial_port import SerialPort
from thumper.gps.fix import Fix
from thumper.gps.nmea import SentenceDecoder, fix_of_gga, with_gst
from thumper.gps.ubx import COV, NAV_COV, NAV_PVT, PVT, UbxFrame, UbxSplitter, fix_of_pvt, with_cov

START_TIMEOUT_S = 2.5
MAX_CLOCK_DRIFT = 1e-4  # of the computer's clock
JUMP_S = 1.0  # the receiver's time was set, or the day or week ended


class GpsDriver(StreamSensor[Fix]):
    """A streaming GPS receiver. The constructor waits for the first message; `poll` never waits."""

    NAME = "GPS receiver"
    SILENT = "check its cable and [gps] baud, and that its port sends NMEA or UBX-NAV-PVT"

    def __init__(self, port: SerialPort, *, latency_s: float) -> None:
        """Read `port` until the first message arrives; a fix may take minutes longer.

        Raises
        ------
        ThumperError
            No data arrives, or none that is NMEA or NAV-PVT (exit code 3).
        """
        super().__init__(port)
        self._nmea, self._ubx = SentenceDecoder(), UbxSplitter()
        self._latency_s = latency_s
        self._clock = _EpochClock()
        self._pending: tuple[object, Fix] | None = None  # an epoch that waits for its accuracy
        self._has_accuracy = self._has_pvt = False
        self._start(
            START_TIMEOUT_S,
            self._recognizes,
            foreign=f"the device on {port.url} sends neither NMEA nor UBX-NAV-PVT at {port.baud} baud; "
            "correct [gps] port or baud",
        )

    def _recognizes(self, data: bytes) -> bool:
        frames, rest = self._ubx.feed(data)
        for _ in self._nmea.feed(rest):
            pass
        return self._nmea.good > 0 or any(frame.kind == NAV_PVT for frame in frames)

    def _decode(self, data: bytes, now_s: float) -> list[Fix]:
        frames, rest = self._ubx.feed(data)
        fixes = [fix for frame in frames for fix in self._take_frame(frame, now_s)]
        for message in self._nmea.feed(rest):
            if not self._has_pvt:
                fixes += self._take_sentence(message, now_s)
        self.counters.bad_replies = self._nmea.bad + self._ubx.bad
        return fixes

    def _take_frame(self, frame: UbxFrame, now_s: float) -> list[Fix]:
        if frame.kind == NAV_PVT and len(frame.payload) >= PVT.size:
            if not self._has_pvt:  # what waits is the same epoch as NMEA
                self._has_pvt, self._has_accuracy, self._pending = True, False, None
            fix = fix_of_pvt(frame.payload, self._time_s(1e-3 * frame.week_ms, now_s))
            if fix is not None:
                return self._begin(frame.week_ms, fix)
            self._ubx.bad += 1
        elif frame.kind == NAV_COV and len(frame.payload) >= COV.size:
            return self._complete(frame.week_ms, with_cov, frame.payload)
        return []

    def _take_sentence(self, message: Any, now_s: float) -> list[Fix]:
        if message.msgID == "GST":
            return self._complete(message.time, with_gst, message)
        if not isinstance(message.time, time):  # just powered on: it has no time yet
            return self._begin(message.time, Fix(time_s=now_s - self._latency_s))
        at = message.time
        day_s = 3600.0 * at.hour + 60.0 * at.minute + at.second + 1e-6 * at.microsecond
        return self._begin(at, fix_of_gga(message, self._time_s(day_s, now_s)))

    def _begin(self, epoch: object, fix: Fix) -> list[Fix]:
        """Take the fix of an epoch; return what is complete: the fix before it, whose accuracy is lost."""
        fixes = self._take_pending()
        self._pending = (epoch, fix)
        return fixes if self._has_accuracy else [*fixes, *self._take_pending()]

    def _complete(self, epoch: object, with_accuracy: Callable[[Fix, Any], Fix], content: Any) -> list[Fix]:
        self._has_accuracy = True
        if self._pending is None or self._pending[0] != epoch:
            return []
        self._pending = (epoch, with_accuracy(self._pending[1], content))
        return self._take_pending()

    def _take_pending(self) -> list[Fix]:
        pending, self._pending = self._pending, None
        return [] if pending is None else [pending[1]]

    def _time_s(self, epoch_s: float, now_s: float) -> float:
        return self._clock.measured_s(epoch_s, now_s) - self._latency_s


class _EpochClock:
    """Maps the receiver's time of day, or of week, to the host's clock.

    Data waits in the host until it is read, so the smallest lag holds for all.
    """

    def __init__(self) -> None:
        self._lag_s = math.inf
        self._epoch_s = 0.0

    def measured_s(self, epoch_s: float, now_s: float) -> float:
        """Return when the epoch's data would have arrived without waiting."""
        lag_s, drifted_s = now_s - epoch_s, self._lag_s + MAX_CLOCK_DRIFT * abs(epoch_s - self._epoch_s)
        self._lag_s = lag_s if lag_s > drifted_s + JUMP_S else min(lag_s, drifted_s)
        self._epoch_s = epoch_s
        return epoch_s + self._lag_s
