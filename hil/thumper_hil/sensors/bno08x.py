"""Simulate a BNO08x in UART-RVC mode on simulated time: from power-on it sends a frame every 10 ms.

The format is that of the BNO08X data sheet (1.3.5.2). The yaw comes from its game rotation vector, whose
heading drifts by 0.5 deg/min; the bound is taken as one sigma. The noise is that of the gyroscope inside
(BMI055: 0.014 deg/s/sqrt(Hz)). The oscillator inside is accurate to about 1 %.
"""

import math
import struct
from collections.abc import Callable

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_hil.lidars.outbox import Outbox

FRAME_HZ = 100.0
CLOCK_SPREAD = 0.005  # relative, from unit to unit
DRIFT_RAD_S = math.radians(0.5 / 60.0)
NOISE_RAD_S = math.radians(0.014)  # std of the mean rate over 1 s
TILT_NOISE_DEG = 0.05
ACCELERATION_NOISE_MG = 5.0
BAUD = 115_200
WIRE_S = 19 * 10.0 / BAUD


def write_frame(index: int, angles_deg: tuple[float, ...], acceleration_mg: tuple[float, ...]) -> bytes:
    """Return a frame: yaw, pitch, roll within their ranges, and the acceleration along x, y, z."""
    hundredths = (round(100.0 * angle) for angle in angles_deg)
    content = struct.pack("<B6h3x", index % 256, *hundredths, *map(round, acceleration_mg))
    return b"\xaa\xaa" + content + bytes([sum(content) & 0xFF])


class Bno08x:
    """The device. The caller owns the clock: call `advance`, then `read` the bytes that have arrived.

    `pose_at(times_s)` and `pitch_at(times_s)` return the robot's pose, shape (n, 3), and pitch, shape (n,),
    at times up to two frames back. The same seed and poses give the same frames, in steps of any size.
    """

    baud = BAUD

    def __init__(
        self,
        *,
        pose_at: Callable[[FloatArray], FloatArray],
        pitch_at: Callable[[FloatArray], FloatArray],
        seed: int,
        power_on_s: float = 0.0,
    ) -> None:
        rng = np.random.default_rng([seed, 3])
        self._pose_at, self._pitch_at, self._rng = pose_at, pitch_at, rng
        self._period_s = (1.0 + CLOCK_SPREAD * float(rng.standard_normal())) / FRAME_HZ
        self.drift_rad_s = DRIFT_RAD_S * float(rng.standard_normal())
        self._power_on_s = power_on_s
        self._frames = 0
        self._error_rad = 0.0  # of the yaw
        self._start_rad: float | None = None  # the heading at power-on, which the device calls 0
        self._outbox = Outbox()
        self._now_s = power_on_s

    def write(self, data: bytes, time_s: float) -> None:
        """Ignore bytes from the host: in this mode the device takes no commands."""

    def advance(self, time_s: float) -> None:
        """Advance time and send the frames that are due by then."""
        due = math.floor((time_s - self._power_on_s) / self._period_s) - self._frames
        if due > 0:
            numbers = self._frames + 1.0 + np.arange(due, dtype=np.float64)
            times_s = self._power_on_s + self._period_s * numbers
            for pose, pitch_rad, at_s in zip(
                self._pose_at(times_s), self._pitch_at(times_s), times_s, strict=True
            ):
                self._send(float(pose[2]), float(pitch_rad), float(at_s))
        self._now_s = max(self._now_s, time_s)

    def read(self) -> bytes:
        """Return the bytes that have reached the host."""
        return self._outbox.arrived(self._now_s)

    def _send(self, heading_rad: float, pitch_rad: float, time_s: float) -> None:
        noise = self._rng.standard_normal(6)
        if self._start_rad is None:
            self._start_rad = heading_rad
        self._error_rad += self.drift_rad_s * self._period_s
        self._error_rad += NOISE_RAD_S * math.sqrt(self._period_s) * float(noise[0])
        yaw_rad = math.remainder(heading_rad - self._start_rad + self._error_rad, math.tau)
        pitch_deg = math.degrees(pitch_rad) + TILT_NOISE_DEG * float(noise[1])
        gravity_mg = 1e3 * np.array([-math.sin(pitch_rad), 0.0, math.cos(pitch_rad)])
        acceleration_mg = gravity_mg + ACCELERATION_NOISE_MG * noise[3:]
        self._frames += 1
        frame = write_frame(
            self._frames,
            (math.degrees(yaw_rad), pitch_deg, TILT_NOISE_DEG * float(noise[2])),
            tuple(acceleration_mg.tolist()),
        )
        self._outbox.send(frame, time_s + WIRE_S)
