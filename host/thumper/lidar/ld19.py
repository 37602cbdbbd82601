"""Driver of the LDROBOT LD19 (and LD06), which streams from power-on and takes no commands."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from thumper.common.sensor import StreamSensor
from thumper.common.serial_port import SerialPort
from thumper.lidar.clock import STREAM_WINDOW_S, ClockSync
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
"""Transmission time of a frame, 2 ms: a frame is at least this old when it is read."""

START_TIMEOUT_S = 4.0  # the head needs up to 3 s to reach its speed
STAMP_RESOLUTION_S = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Ld19Options:
    """Options of the driver."""

    # Read a distance of 0 as "no return" (+inf) instead of invalid, as for the URG-04LX.
    zero_as_no_return: bool = False
    # Points with a lower intensity are invalid [0 ... 255].
    min_intensity: Annotated[int, Ge(0), Le(255)] = 0


class Ld19Driver(StreamSensor[Scan]):
    """A streaming lidar. The constructor waits for the first frame; `poll` never waits."""

    NAME = "lidar"
    SILENT = "check that it has 5 V, that its head spins and that its TX wire goes to the adapter's RX"

    def __init__(self, port: SerialPort, *, options: Ld19Options | None = None) -> None:
        """Read `port` until the first frame arrives.

        Raises
        ------
        ThumperError
            No data arrives, or the data is not from an LD19 (exit code 3).
        """
        self._options = options or Ld19Options()
        super().__init__(port)
        self._decoder = Ld19Decoder()
        self._assembler = RevolutionAssembler()
        # The stamp is assumed to be that of the frame's last point, after which the frame is sent.
        self._clock_sync = ClockSync(wrap_ms=STAMP_WRAP_MS, least_lag_s=WIRE_S, window_s=STREAM_WINDOW_S)
        self._start(
            START_TIMEOUT_S,
            lambda data: bool(self._decoder.feed(data)),
            foreign=f"the device on {port.url} is not an LD19 at {port.baud} baud "
            f"(an LD19 needs {BAUD}); correct [lidar] port, model and baud",
        )

    def close(self) -> None:
        """Close the port. The head keeps turning: the LD19 has no stop command."""
        self._port.close()

    def _decode(self, data: bytes, now_s: float) -> list[Scan]:
        revolutions = [self._add(frame, now_s) for frame in self._decoder.feed(data)]
        self.counters.bad_replies = self._decoder.bad_frames
        return [self._scan(one) for one in revolutions if one is not None]

    def _add(self, frame: Ld19Frame, received_s: float) -> Revolution | None:
        # The sensor truncates stamps to whole milliseconds, so they are half a millisecond early on average.
        # The smallest lag belongs to a stamp that was hardly truncated. So correct the mean by half a
        # millisecond and leave the minimum as it is.
        stamped_s = self._clock_sync.host_time_s(frame.stamp_ms, received_s)
        return self._assembler.feed(frame, stamped_s + 0.5 * STAMP_RESOLUTION_S, POINT_S)

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
