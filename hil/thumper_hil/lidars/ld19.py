"""Simulate an LDROBOT LD19 on simulated time: from power-on it only sends, in frames of 12 points.

The data sheet gives 4500 points per second, 10 revolutions per second, 0.02 to 12 m, accuracy 45 mm (mean of
100) and standard deviation 10 mm between 0.3 and 12 m, and an angle error of at most 2 degrees. The bounds
are taken as three sigma. The data sheet has no figure for drop-outs, so there are none: every target in range
returns an echo, unless `effects/` takes it away.
"""

import math
import struct
from collections.abc import Callable

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper_hil.lidars.beams import UNDISTURBED, BeamConditions, Beams
from thumper_hil.lidars.outbox import Outbox
from thumper_hil.world.echoes import WorldAt

POINTS_PER_S = 4500.0
POINTS_PER_FRAME = 12
TURNS_PER_S = 10.0
SPEED_STD = 0.005  # relative, from unit to unit; the motor speed is regulated to 10 Hz
RANGE_MIN_M, RANGE_MAX_M = 0.02, 12.0
BIAS_M, NOISE_M = 0.015, 0.010
ANGLE_ERROR_DEG = 2.0 / 3.0
INTENSITY = 200  # white targets within 6 m
STAMP_WRAP_MS = 30_000
BAUD = 230_400
WIRE_S_PER_BYTE = 10.0 / BAUD


def check_byte(data: bytes) -> int:
    """Return the CRC-8 with polynomial 0x4D and initial value 0."""
    remainder = 0
    for byte in data:
        remainder ^= byte
        for _ in range(8):
            remainder = (remainder << 1) ^ (0x14D if remainder & 0x80 else 0)
    return remainder


def write_frame(
    speed_deg_s: float, angles_deg: FloatArray, ranges_mm: FloatArray, intensity: FloatArray, time_s: float
) -> bytes:
    """Return the frame of 12 points; angles are clockwise and may exceed one revolution."""
    first, last = (round(100.0 * angle) % 36_000 for angle in (angles_deg[0], angles_deg[-1]))
    frame = struct.pack("<BBHH", 0x54, 0x2C, round(speed_deg_s), first)
    for range_mm, echo in zip(ranges_mm, intensity, strict=True):
        frame += struct.pack("<HB", int(range_mm), int(echo))
    frame += struct.pack("<HH", last, math.floor(1000.0 * time_s) % STAMP_WRAP_MS)
    return frame + bytes([check_byte(frame)])


class Ld19:
    """The lidar. The caller owns the clock: call `advance`, then `read` the bytes that have arrived.

    `pose_at(times_s)` is as for the URG-04LX, called with times up to two frames back. The same seed and the
    same poses give the same frames, in steps of any size.
    """

    def __init__(
        self,
        *,
        world: WorldAt,
        pose_at: Callable[[FloatArray], FloatArray],
        base_from_laser: Pose2,
        seed: int,
        conditions: BeamConditions = UNDISTURBED,
    ) -> None:
        self._beams = Beams(
            world=world,
            pose_at=pose_at,
            base_from_laser=base_from_laser,
            range_max_m=RANGE_MAX_M,
            conditions=conditions,
        )
        self._clock_rate = 1.0 + conditions.clock_drift
        self._delay_s = conditions.delay_s
        self._seed = seed
        self._arrived_s = 0.0
        rng = np.random.default_rng(seed)
        self._turns_per_s = TURNS_PER_S * (1.0 + SPEED_STD * rng.standard_normal())
        self._first_deg = float(rng.uniform(0.0, 360.0))
        self._booted_s = -float(rng.uniform(5.0, 500.0))
        self._bias_m = BIAS_M * rng.standard_normal()
        self._angle_error_rad = math.radians(ANGLE_ERROR_DEG * rng.standard_normal())
        self._rng = rng
        self._points = 0
        self._outbox = Outbox()
        self._now_s = 0.0

    baud = BAUD

    def write(self, data: bytes, time_s: float) -> None:
        """Ignore bytes from the host: the LD19 has no receive line."""

    def advance(self, time_s: float) -> None:
        """Advance time and send the frames that end by then."""
        frames = math.floor(time_s * POINTS_PER_S / POINTS_PER_FRAME) - self._points // POINTS_PER_FRAME
        if frames > 0:
            self._measure(frames)
        self._now_s = max(self._now_s, time_s)

    def read(self) -> bytes:
        """Return the bytes that have reached the host."""
        return self._outbox.arrived(self._now_s)

    def _measure(self, frames: int) -> None:
        numbers = self._points + 1 + np.arange(frames * POINTS_PER_FRAME)
        times_s = numbers / POINTS_PER_S
        angles_deg = self._first_deg + 360.0 * self._turns_per_s * times_s
        bearings_rad = self._angle_error_rad - np.deg2rad(angles_deg)
        true_m = self._cast(times_s, bearings_rad)
        measured_m = true_m + self._bias_m + NOISE_M * self._rng.standard_normal(true_m.size)
        in_range = (measured_m >= RANGE_MIN_M) & (true_m <= RANGE_MAX_M)
        ranges_mm = np.rint(1000.0 * np.where(in_range, measured_m, 0.0))
        intensity = np.where(in_range, float(INTENSITY), 0.0)
        for first in range(0, numbers.size, POINTS_PER_FRAME):
            part = slice(first, first + POINTS_PER_FRAME)
            end_s = float(times_s[part][-1])
            frame = write_frame(
                360.0 * self._turns_per_s,
                angles_deg[part],
                ranges_mm[part],
                intensity[part],
                self._clock_rate * (end_s - self._booted_s),
            )
            self._outbox.send(frame, self._arrival_s(end_s, len(frame)))
        self._points += numbers.size

    def _cast(self, times_s: FloatArray, bearings_rad: FloatArray) -> FloatArray:
        """Return the true ranges; disturbances are drawn per frame, so that steps of any size agree."""
        if self._beams.conditions.effects is None:
            return self._beams.cast(times_s, bearings_rad, self._rng)
        parts = []
        for first in range(0, times_s.size, POINTS_PER_FRAME):
            part = slice(first, first + POINTS_PER_FRAME)
            rng = np.random.default_rng([self._seed, self._points + first, 2])
            parts.append(self._beams.cast(times_s[part], bearings_rad[part], rng))
        return np.concatenate(parts)

    def _arrival_s(self, end_s: float, size: int) -> float:
        """Return when a frame reaches the host: after the wire and a delay, in the order of sending."""
        delay_s = 0.0
        if self._delay_s:
            rng = np.random.default_rng([self._seed, round(1e4 * end_s), 1])
            delay_s = self._delay_s * float(rng.random())
        self._arrived_s = max(self._arrived_s, end_s + WIRE_S_PER_BYTE * size + delay_s)
        return self._arrived_s
