"""Simulate a u-blox ZED-F9P on simulated time: at each epoch it sends RMC, GGA and GST.

The sentences are those of NMEA 0183 4.10 (u-blox F9 HPG interface description, 2.7). The accuracies are those
of the data sheet (ZED-F9P-04B, table 2), horizontal, as circles that hold 50 % of 24 hours: 1.5 m
autonomous, 1.0 m with SBAS, 0.01 m with RTK. How they split into a slow part (orbits and ionosphere), the
multipath of a moving antenna and white noise is assumed, and so is the growth of the multipath near walls.
The world's x axis points east, and its origin is at `DATUM`.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.gps.local_plane import EastNorth, LatLon, LocalPlane
from thumper_hil.faults.switches import Switches
from thumper_hil.lidars.outbox import Outbox

BAUD = 38_400
DATUM = LatLon(48.2625, 11.6680)
ALTITUDE_M, GEOID_M = 480.0, 45.9  # above the sea; sea above the ellipsoid
START_OF_RUN_S = 12 * 3600.0  # time of day
SLOW_S, MULTIPATH_S = 1000.0, 60.0  # correlation times
WALL_FACTOR, WALL_M = 3.0, 2.0  # multipath at a wall, and the distance in which it decays
ACQUISITION_S = 2.0  # hot start; data sheet
RTK_CONVERGENCE_S = 10.0
LATENCY_S, LATENCY_SPREAD_S = 0.08, 0.04  # until the first sentence, from unit to unit


@dataclass(frozen=True, slots=True, kw_only=True)
class FixKind:
    """Quality digit of GGA, digits of the minutes, and standard deviations per axis [m]."""

    quality: int
    slow_m: float
    multipath_m: float
    white_m: float
    decimals: int = 5

    @property
    def std_m(self) -> float:
        """Of the whole error per axis [m]."""
        return math.hypot(self.slow_m, self.multipath_m, self.white_m)


KINDS = {
    "autonomous": FixKind(quality=1, slow_m=0.9, multipath_m=0.8, white_m=0.4),
    "sbas": FixKind(quality=2, slow_m=0.55, multipath_m=0.55, white_m=0.35),
    "rtk": FixKind(quality=4, slow_m=0.0, multipath_m=0.006, white_m=0.006, decimals=7),
}
FLOAT = FixKind(quality=5, slow_m=0.0, multipath_m=0.3, white_m=0.1, decimals=7)


class GnssReceiver:
    """The device. The caller owns the clock: call `advance`, then `read` the bytes that have arrived.

    `pose_at(times_s)` returns the robot's pose, shape (n, 3), at times up to an epoch back; the antenna is
    above its origin. `wall_m(x, y)` is the distance to the nearest wall.
    """

    baud = BAUD

    def __init__(
        self,
        *,
        pose_at: Callable[[FloatArray], FloatArray],
        wall_m: Callable[[float, float], float],
        faults: Switches,
        kind: str,
        rate_Hz: float,
        seed: int,
        power_on_s: float = 0.0,
    ) -> None:
        self._rng = np.random.default_rng([seed, 5])
        self._pose_at, self._wall_m, self._faults = pose_at, wall_m, faults
        self._kind, self._period_s = KINDS[kind], 1.0 / rate_Hz
        self._latency_s = LATENCY_S + LATENCY_SPREAD_S * float(self._rng.uniform(-1.0, 1.0))
        self._epoch = math.ceil(power_on_s * rate_Hz)  # epochs are at whole multiples of the period
        self._sky_since_s = power_on_s
        self._slow, self._multipath = self._rng.standard_normal(2), self._rng.standard_normal(2)  # unit std
        self._plane = LocalPlane(DATUM)
        self._outbox = Outbox()
        self._now_s = power_on_s

    def write(self, data: bytes, time_s: float) -> None:
        """Ignore bytes from the host: the configuration is in the receiver's flash."""

    def advance(self, time_s: float) -> None:
        """Advance time and send the epochs that have passed."""
        while self._epoch * self._period_s <= time_s:
            self._measure(self._epoch * self._period_s)
            self._epoch += 1
        self._now_s = max(self._now_s, time_s)

    def read(self) -> bytes:
        """Return the bytes that have reached the host."""
        return self._outbox.arrived(self._now_s)

    def _measure(self, time_s: float) -> None:
        self._slow = self._walk(self._slow, SLOW_S)
        self._multipath = self._walk(self._multipath, MULTIPATH_S)
        white = self._rng.standard_normal(2)
        if self._faults.sky_is_blocked:
            self._sky_since_s = time_s
        kind = self._kind_at(time_s)
        arrival_s = time_s + self._latency_s
        if kind is None:
            messages = self._no_fix(START_OF_RUN_S + time_s)
        else:
            x_m, y_m, _ = (float(value) for value in self._pose_at(np.array([time_s]))[0])
            near = 1.0 + WALL_FACTOR * math.exp(-self._wall_m(x_m, y_m) / WALL_M)
            error = kind.slow_m * self._slow + near * kind.multipath_m * self._multipath
            east_m, north_m = np.array([x_m, y_m]) + error + kind.white_m * white
            at = EastNorth(float(east_m) + self._faults.gps_offset_m, float(north_m))
            messages = self._fix(START_OF_RUN_S + time_s, self._plane.to_earth(at), kind)
        for message in messages:
            arrival_s += 10.0 * len(message) / BAUD
            self._outbox.send(message, arrival_s)

    def _fix(self, day_s: float, at: LatLon, kind: FixKind) -> tuple[bytes, ...]:
        """Return the messages of an epoch."""
        return fix_sentences(day_s, at, kind)

    def _no_fix(self, day_s: float) -> tuple[bytes, ...]:
        """Return the messages of an epoch without a position."""
        return no_fix(day_s)

    def _kind_at(self, time_s: float) -> FixKind | None:
        seen_s = time_s - self._sky_since_s
        if seen_s < ACQUISITION_S:
            return None
        is_converging = self._kind.quality == KINDS["rtk"].quality and seen_s < RTK_CONVERGENCE_S
        return FLOAT if is_converging else self._kind

    def _walk(self, error: FloatArray, correlation_s: float) -> FloatArray:
        """Continue a first-order Gauss-Markov process of unit standard deviation by an epoch."""
        keep = math.exp(-self._period_s / correlation_s)
        return np.asarray(keep * error + math.sqrt(1.0 - keep**2) * self._rng.standard_normal(2))


def sentence_of(content: str) -> bytes:
    """Return the sentence with its check sum: the exclusive or of the characters between $ and *."""
    check_sum = 0
    for character in content.encode():
        check_sum ^= character
    return f"${content}*{check_sum:02X}\r\n".encode()


def fix_sentences(day_s: float, at: LatLon, kind: FixKind) -> tuple[bytes, ...]:
    """Return RMC, GGA and GST of an epoch at `day_s` seconds of the day."""
    utc, place, std_m = _utc(day_s), _place(at, kind.decimals), kind.std_m
    mode = {1: "A", 2: "D", 4: "R", 5: "F"}[kind.quality]
    return (
        sentence_of(f"GNRMC,{utc},A,{place},0.0,,010626,,,{mode},V"),
        sentence_of(f"GNGGA,{utc},{place},{kind.quality},12,0.70,{ALTITUDE_M:.1f},M,{GEOID_M:.1f},M,,"),
        sentence_of(f"GNGST,{utc},1.0,,,,{std_m:.3f},{std_m:.3f},{2.0 * std_m:.3f}"),
    )


def no_fix(day_s: float) -> tuple[bytes, ...]:
    """Return the sentences of an epoch without a position."""
    utc = _utc(day_s)
    return (
        sentence_of(f"GNRMC,{utc},V,,,,,,,010626,,,N,V"),
        sentence_of(f"GNGGA,{utc},,,,,0,00,99.99,,M,,M,,"),
        sentence_of(f"GNGST,{utc},,,,,,,"),
    )


def _utc(day_s: float) -> str:
    hundredths = round(100.0 * day_s) % 8_640_000
    minutes, rest = divmod(hundredths, 6000)
    return f"{minutes // 60:02d}{minutes % 60:02d}{rest / 100.0:05.2f}"


def _place(at: LatLon, decimals: int) -> str:
    latitude, longitude = _minutes(at.latitude_deg, 2, decimals), _minutes(at.longitude_deg, 3, decimals)
    return f"{latitude},{'NS'[at.latitude_deg < 0.0]},{longitude},{'EW'[at.longitude_deg < 0.0]}"


def _minutes(angle_deg: float, width: int, decimals: int) -> str:
    """Return an angle as ddmm.mmmmm, or dddmm.mmmmm."""
    units = 10**decimals
    degrees, rest = divmod(round(60 * units * abs(angle_deg)), 60 * units)
    return f"{degrees:0{width}d}{rest / units:0{decimals + 3}.{decimals}f}"
