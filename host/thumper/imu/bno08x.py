"""Driver of the BNO080, BNO085 and BNO086 in UART-RVC mode, which sends from power-on and takes no commands.

A frame of 19 bytes comes each 10 ms: 0xAA 0xAA, index, yaw, pitch and roll in 0.01 deg, acceleration
x, y, z in mg, three reserved bytes, and the sum of all bytes after the header (BNO08X data sheet, 1.3.5.2).
The device sends a yaw and no rate: the rate of a sample is the change of the yaw since the frame before.
"""

import math
import struct
from dataclasses import dataclass

from thumper.common.geometry import wrap_angle
from thumper.common.sensor import StreamSensor
from thumper.common.serial_port import SerialPort
from thumper.imu.options import BNO08X
from thumper.imu.sample import ImuSample

BAUD = 115_200
RATE_HZ = 100.0
PERIOD_S = 1.0 / RATE_HZ
HEADER = b"\xaa\xaa"
FRAME_BYTES = 19
WIRE_S = 10.0 * FRAME_BYTES / BAUD
START_TIMEOUT_S = 1.0
MG_M_S2 = 9.80665e-3
MAX_FRAMES_LOST = 50  # the index says how many are missing, up to 255; a longer gap starts again
LATEST_S = 0.025
"""The newest frame waits at most one period for the next, and 16 ms in a USB adapter's buffer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RvcFrame:
    """The content of a frame."""

    index: int
    yaw_rad: float
    pitch_rad: float
    roll_rad: float
    acceleration_m_s2: tuple[float, float, float]


class RvcDecoder:
    """Splits bytes into frames; drops those that fail their checksum."""

    def __init__(self) -> None:
        self._buffer = b""
        self.bad_frames = 0

    def feed(self, data: bytes) -> list[RvcFrame]:
        """Return the frames that end in these bytes."""
        buffer, frames = self._buffer + data, []
        while len(buffer) >= FRAME_BYTES:
            start = buffer.find(HEADER)
            if start < 0:
                buffer = buffer[-1:]
                break
            buffer = buffer[start:]
            if len(buffer) < FRAME_BYTES:
                break
            if sum(buffer[2:18]) & 0xFF != buffer[18]:
                self.bad_frames += 1
                buffer = buffer[1:]  # the header may have been data
                continue
            frames.append(_parse(buffer[:FRAME_BYTES]))
            buffer = buffer[FRAME_BYTES:]
        self._buffer = buffer
        return frames


def _parse(frame: bytes) -> RvcFrame:
    index, yaw, pitch, roll, *acceleration = struct.unpack("<B6h", frame[2:15])
    x_m_s2, y_m_s2, z_m_s2 = (MG_M_S2 * value for value in acceleration)
    return RvcFrame(
        index=index,
        yaw_rad=math.radians(0.01 * yaw),
        pitch_rad=math.radians(0.01 * pitch),
        roll_rad=math.radians(0.01 * roll),
        acceleration_m_s2=(x_m_s2, y_m_s2, z_m_s2),
    )


class Bno08xDriver(StreamSensor[ImuSample]):
    """A streaming gyroscope. The constructor waits for the first frame; `poll` never waits."""

    NAME = "gyroscope"
    SILENT = "check that PS0 is at 3.3 V (UART-RVC mode) and that its SDA (TX) goes to the adapter's RX"

    def __init__(self, port: SerialPort) -> None:
        """Read `port` until the first frame arrives.

        Raises
        ------
        ThumperError
            No data arrives, or the data is not from a BNO08x in UART-RVC mode (exit code 3).
        """
        super().__init__(port)
        self._decoder = RvcDecoder()
        self._last: RvcFrame | None = None
        self._last_s = 0.0
        self._start(
            START_TIMEOUT_S,
            lambda data: bool(self._decoder.feed(data)),
            foreign=f"the device on {port.url} is not a BNO08x in UART-RVC mode; correct [imu] port, "
            "or connect PS0 to 3.3 V and PS1 to ground",
        )

    def _decode(self, data: bytes, now_s: float) -> list[ImuSample]:
        frames = self._decoder.feed(data)
        self.counters.bad_replies = self._decoder.bad_frames
        samples = []
        if frames:
            for frame, time_s in zip(frames, self._stamps_s(frames, now_s), strict=True):
                if self._last is not None and time_s > self._last_s:
                    samples.append(_sample(frame, time_s, self._last, self._last_s))
                self._last, self._last_s = frame, time_s
        return samples

    def _stamps_s(self, frames: list[RvcFrame], now_s: float) -> list[float]:
        """Return the time of each frame: the frames have no stamps, but come 10 ms apart.

        The newest one was sent at most `LATEST_S` before it is read. Within that, the clock runs on from the
        frames before, so that the stamps are more even than the reads.
        """
        before = frames[0] if self._last is None else self._last
        indices = [(frame.index - before.index) % 256 for frame in frames]
        newest_s = now_s - WIRE_S
        if self._last is not None and indices[-1] <= MAX_FRAMES_LOST:
            expected_s = self._last_s + PERIOD_S * indices[-1]
            newest_s = min(max(expected_s, newest_s - LATEST_S), newest_s)
        else:
            self._last = None
        step_s = PERIOD_S
        if self._last is not None:
            step_s = (newest_s - self._last_s) / max(indices[-1], 1)
        return [newest_s - step_s * (indices[-1] - index) for index in indices]


def _sample(frame: RvcFrame, time_s: float, last: RvcFrame, last_s: float) -> ImuSample:
    return ImuSample(
        time_s=time_s,
        yaw_rate_rad_s=wrap_angle(frame.yaw_rad - last.yaw_rad) / (time_s - last_s),
        yaw_rate_std_rad_s=BNO08X.mean_rate_std_rad_s(time_s - last_s),
        roll_rad=frame.roll_rad,
        pitch_rad=frame.pitch_rad,
        yaw_rad=frame.yaw_rad,
        acceleration_m_s2=frame.acceleration_m_s2,
    )
