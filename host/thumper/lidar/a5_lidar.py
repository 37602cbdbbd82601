"""Driver of the lidars that speak the A5 protocol: RPLIDAR A1, A2 and C1, YDLIDAR X4."""

import math
import struct
from dataclasses import dataclass

from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.common.sensor import READ_TIMEOUT_S, StreamSensor
from thumper.common.serial_port import PortError, SerialPort
from thumper.lidar.a5_models import A5Model, find_model, unknown_text
from thumper.lidar.a5_protocol import (
    HEALTH_ERROR,
    HEALTH_TYPE,
    INFO_TYPE,
    SAMPLE_RATE_TYPE,
    DeviceInfo,
    find_reply,
)
from thumper.lidar.driver import LidarCounters
from thumper.lidar.point_packet import PacketDecoder
from thumper.lidar.scan import Scan
from thumper.lidar.scan_builder import ScanBuilder

QUIET_S = 0.05  # a stopped lidar sends what it has measured
ANSWER_S = 0.5
TRIES = 3
RESET_S = 1.0  # the lidar prints a greeting after it
START_TIMEOUT_S = 5.0  # the head needs up to 2 s to reach its speed
SILENCE_S = 3.0
"""Start again after this time without a scan."""

DEFAULT_POINT_S = 500e-6
MAX_PENDING_BYTES = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class RplidarOptions:
    """Options of the driver, also with a YDLIDAR."""

    # Use express scans, which have more points and a checksum. Off: the standard scans of old firmware.
    express: bool = True
    # Read a range of 0 as "no return" (+inf) instead of invalid, as for the URG-04LX.
    zero_as_no_return: bool = False


class A5Lidar(StreamSensor[Scan]):
    """A streaming lidar. The constructor asks what it is and starts it, in 2 s; `poll` never waits."""

    NAME = "lidar"
    SILENT = "is its head free, and does its supply give 5 V and 1 A?"

    def __init__(self, port: SerialPort, *, model: A5Model, options: RplidarOptions | None = None) -> None:
        """Start motor and scan of the lidar on `port`.

        Raises
        ------
        ThumperError
            No lidar answers, it is another one, it reports an error, or it sends no points (exit code 3).
        """
        super().__init__(port)
        self._options = options or RplidarOptions()
        self.model = model
        self.counters: LidarCounters = LidarCounters()
        self._pending: bytes | None = b""  # what came before the reply to the scan request; None after it
        self._decoder: PacketDecoder | None = None
        self._builder: ScanBuilder | None = None
        self._has_points = False
        self._stop_scan()
        self.info = self._identify()
        self._check_health()
        self._periods_s = self._ask_periods_s()
        self._run_scan()
        self._wait_for_points()

    def close(self) -> None:
        """Stop scan and motor and close the port, even if the device is gone."""
        try:
            self._run(run=False)
        except PortError:
            self.counters.port_errors += 1
        self._port.close()

    def _run(self, *, run: bool) -> None:
        """Start or stop motor and scan, without waiting."""
        model = self.model
        if (level := model.dtr(run=run)) is not None:
            self._port.set_dtr(level)
        is_express = bool(model.express) and self._options.express
        scan = (model.express if is_express else model.scan) if run else b""
        self._port.write(model.stop + model.motor_request(run=run) + scan)

    def _stop_scan(self) -> None:
        """Stop a scan that is under way, and read what it has sent."""
        self._port.write(self.model.stop)
        until_s = self.now_s() + ANSWER_S
        while self._port.read_available(QUIET_S) and self.now_s() < until_s:
            pass

    def _ask(self, request: bytes, kind: int) -> bytes | None:
        """Return the content of the reply, or None if none comes."""
        for _ in range(TRIES):
            self._port.write(request)
            received = b""
            until_s = self.now_s() + ANSWER_S
            while self.now_s() < until_s:
                received += self._port.read_available(READ_TIMEOUT_S)
                if (reply := find_reply(received, {kind})) is not None:
                    return reply[1]
        return None

    def _identify(self) -> DeviceInfo:
        content = self._ask(self.model.info, INFO_TYPE)
        if content is None:
            needs = "" if self._port.baud == self.model.baud else f" (it needs {self.model.baud})"
            raise ThumperError(
                f"no {self.model.name} answers on {self._port.url} at {self._port.baud} baud{needs}; "
                "check its cable and supply, and [lidar] port, model and baud",
                exit_code=EXIT_NOT_THERE,
            )
        info = DeviceInfo.parse(content)
        if info.model not in self.model.ids:
            found = find_model(info, self.model)
            is_a = f'is a {found[1].name}; set [lidar] model = "{found[0]}"' if found else unknown_text(info)
            raise ThumperError(f"the lidar on {self._port.url} {is_a}", exit_code=EXIT_NOT_THERE)
        return info

    def _check_health(self) -> None:
        """Raise if the lidar reports an error, also after a reset."""
        for is_last in (False, True):
            content = self._ask(self.model.health, HEALTH_TYPE)
            if content is None or content[0] != HEALTH_ERROR:
                return
            if is_last:
                raise ThumperError(
                    f"the {self.model.name} on {self._port.url} reports error "
                    f"{int.from_bytes(content[1:3], 'little'):#x} and has stopped; free its head and plug it "
                    "in again",
                    exit_code=EXIT_NOT_THERE,
                )
            self._port.write(self.model.reset)
            until_s = self.now_s() + RESET_S
            while self.now_s() < until_s:
                self._port.read_available(QUIET_S)

    def _ask_periods_s(self) -> tuple[float, float]:
        """Return the time from point to point of standard and express scans."""
        if self.model.point_s is not None:
            return self.model.point_s, self.model.point_s
        content = self._ask(self.model.sample_rate, SAMPLE_RATE_TYPE)
        if content is None or not all(periods_us := struct.unpack_from("<HH", content)):
            return DEFAULT_POINT_S, DEFAULT_POINT_S
        return 1e-6 * periods_us[0], 1e-6 * periods_us[1]

    def _run_scan(self) -> None:
        self._last_scan_s = self.now_s()
        self._pending = b""
        self._run(run=True)

    def _wait_for_points(self) -> None:
        until_s = self.now_s() + START_TIMEOUT_S
        while not self._has_points:
            if self.now_s() > until_s:
                raise ThumperError(
                    f"the {self.model.name} on {self._port.url} answers but sends no points; {self.SILENT}",
                    exit_code=EXIT_NOT_THERE,
                )
            self._receive(READ_TIMEOUT_S)

    def _decode(self, data: bytes, now_s: float) -> list[Scan]:
        scans = self._scans(data, now_s)
        if scans:
            self._last_scan_s = now_s
        elif now_s - self._last_scan_s > SILENCE_S:
            self.counters.restarts += 1
            try:
                self._run_scan()
            except PortError:
                self.counters.port_errors += 1
        return scans

    def _scans(self, data: bytes, now_s: float) -> list[Scan]:
        if self._pending is not None:
            self._pending = (self._pending + data)[-MAX_PENDING_BYTES:]
            reply = find_reply(self._pending, self.model.decoders)
            if reply is None:
                return []
            self._pending, data = None, reply[1]
            self._prepare(reply[0])
        if self._decoder is None or self._builder is None:
            return []
        before = self._decoder.bad_packets, self._builder.lost_points
        packets = self._decoder.feed(data)
        scans = self._builder.feed(packets, now_s)
        self._has_points |= bool(packets)
        self.counters.bad_replies += self._decoder.bad_packets - before[0]
        self.counters.lost_points += self._builder.lost_points - before[1]
        return scans

    def _prepare(self, kind: int) -> None:
        """Set up for the kind of packets that the lidar has announced."""
        self._decoder = self.model.decoders[kind]()
        point_s = self._periods_s[self.model.express != b"" and kind != min(self.model.decoders)]
        wire_s = 10.0 * self._decoder.sent_bytes / self._port.baud
        self._builder = ScanBuilder(
            point_s=point_s,
            delay_s=wire_s + point_s * self._decoder.held_points,
            gap_points=self._decoder.gap_points,
            range_limits_m=(self.model.range_min_m, self.model.range_max_m),
            no_return_m=math.inf if self._options.zero_as_no_return else math.nan,
        )
