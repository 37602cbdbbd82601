"""Simulate a lidar that speaks the A5 protocol, on simulated time: requests, motor and points.

The models add how they answer and how they pack points. The head is at its speed `SPIN_UP_S` after the motor
starts, and only then the lidar measures (Slamtec LR001). Each point is measured at its own time, from the
robot's pose at that time.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import reduce
from operator import xor

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper_hil.lidars.beams import UNDISTURBED, BeamConditions, Beams
from thumper_hil.lidars.outbox import Outbox
from thumper_hil.world.echoes import WorldAt

SPIN_UP_S = 1.5
ANSWER_S = 0.002
RESET_S = 0.5
FILTER_POINTS = 1.5  # a point leaves the lidar that long after its middle (Slamtec's SDK)
WANDER, WANDER_S = 0.01, 7.0  # of the speed of a motor without control; assumed
INFO_TYPE, HEALTH_TYPE = 0x04, 0x06


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """The data sheet of a model, with one sigma of bias and noise."""

    baud: int
    model: int
    firmware: tuple[int, int]
    hardware: int
    turns_per_s: float
    turns_spread: float  # relative, one sigma, from unit to unit
    has_speed_control: bool
    range_min_m: float
    range_max_m: float
    bias_m: float
    bias_share: float
    noise_m: float
    noise_per_m: float  # of the range squared: triangulation loses with the square
    motor_dtr: bool | None  # the state of DTR that runs the motor; None: DTR is not connected
    turns_only_in_scans: bool = False


@dataclass(slots=True)
class A5Stream:
    """A scan under way: what it sends, its rate, and what was sent."""

    kind: int
    points_per_s: float
    requested_s: float
    points: int = 0
    packets: int = 0


def reply(kind: int, content: bytes, *, streams: bool = False, length: int | None = None) -> bytes:
    """Return a reply with its descriptor."""
    size = (len(content) if length is None else length) | (1 << 30 if streams else 0)
    return b"\xa5\x5a" + size.to_bytes(4, "little") + bytes((kind,)) + content


class A5Device(ABC):
    """The lidar. The caller owns the clock: `write` requests, `advance` time, `read` the replies.

    `pose_at(times_s)` is as for the URG-04LX, called with times up to two packets back. The same seed,
    requests and poses give the same bytes, in steps of any size.
    """

    figures: Figures
    stop_commands: frozenset[int]
    reset_command: int
    info_command: int
    health_commands: frozenset[int]
    packet_points: int
    motor_starts_on = True  # at the start of the simulation, as far as commands decide

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
            range_max_m=self.figures.range_max_m,
            conditions=conditions,
        )
        self._rate = 1.0 + conditions.clock_drift
        self._delay_s = conditions.delay_s
        self._seed = seed
        rng = np.random.default_rng(seed)
        spread = 1.0 + self.figures.turns_spread * rng.standard_normal()
        self._turns_per_s = self.figures.turns_per_s * spread
        self._first_deg = float(rng.uniform(0.0, 360.0))
        self._bias = float(rng.standard_normal())
        self._serial = rng.bytes(16)
        self.health = 0
        self.is_blocked = False
        self._dtr = self.figures.motor_dtr
        self._pwm_runs = self.motor_starts_on
        self._spinning_s: float | None = 0.0  # since when the head turns at its speed
        self._input = bytearray()
        self._outbox = Outbox()
        self._stream: A5Stream | None = None
        self._wire_free_s = self._arrived_s = self._now_s = self._deaf_until_s = 0.0

    @property
    def baud(self) -> int:
        """The only baud rate at which it understands and is understood."""
        return self.figures.baud

    @property
    def is_turning(self) -> bool:
        """Whether the motor runs, at its speed or on the way to it."""
        return self._spinning_s is not None

    def set_dtr(self, level: bool, time_s: float) -> None:
        """Set the line DTR of the adapter at `time_s`."""
        self.advance(time_s)
        self._dtr = level
        self._update_motor()

    def power_off(self) -> None:
        """Lose the supply: the scan ends, and the motor starts as after power-on."""
        self._stream, self._spinning_s = None, None
        self._input.clear()
        self._outbox = Outbox()
        self._pwm_runs = True

    def write(self, data: bytes, time_s: float) -> None:
        """Receive bytes from the host at `time_s`, which never decreases."""
        self.advance(time_s)
        if time_s < self._deaf_until_s:
            return
        self._input += data
        while self._take_request():
            pass

    def advance(self, time_s: float) -> None:
        """Advance time and send the packets that end by then."""
        self._now_s = max(self._now_s, time_s)
        self._update_motor()
        stream = self._stream
        while stream is self._stream and stream is not None and self._spinning_s is not None:
            first_s = max(stream.requested_s, self._spinning_s)
            numbers, end_s = self._next_points(stream, first_s)
            if end_s > self._now_s:
                break
            self._send_packet(stream, numbers, first_s)

    def read(self) -> bytes:
        """Return the bytes that have reached the host."""
        return self._outbox.arrived(self._now_s)

    @abstractmethod
    def scan_kind(self, command: int, payload: bytes) -> A5Stream | None:
        """Return the scan that a request starts; None if it is another request."""

    @abstractmethod
    def answer(self, command: int, payload: bytes) -> bytes:
        """Return the reply to a request of the model; empty if it has none."""

    @abstractmethod
    def pack(self, kind: int, head_deg: FloatArray, angles_deg: FloatArray, ranges_m: FloatArray) -> bytes:
        """Return the packet of points: angles of head and points, clockwise; a range of 0 is invalid."""

    @abstractmethod
    def turned_deg(self, ranges_m: FloatArray) -> FloatArray:
        """Return how far points at these ranges are from the head's angle."""

    def burst_bytes(self, kind: int, packet: bytes) -> int:
        """Return how many bytes of a packet are sent after its last point."""
        return len(packet)

    def _update_motor(self) -> None:
        runs = self._pwm_runs and not self.is_blocked
        runs &= self.figures.motor_dtr in {None, self._dtr}
        runs &= self._stream is not None or not self.figures.turns_only_in_scans
        if not runs:
            self._spinning_s = None
        elif self._spinning_s is None:
            self._spinning_s = self._now_s + SPIN_UP_S
            if self._stream is not None:
                self._stream.points = 0

    def _take_request(self) -> bool:
        """Execute the first complete request in the input."""
        start = self._input.find(0xA5)
        del self._input[: start if start >= 0 else len(self._input)]
        if len(self._input) < 2:
            return False
        command, payload, size = self._input[1], b"", 2
        if command & 0x80 and not self._is_plain(command):
            if len(self._input) < 3 or len(self._input) < (size := 4 + self._input[2]):
                return False
            if reduce(xor, self._input[:size]) != 0:
                del self._input[:1]
                return True
            payload = bytes(self._input[3 : size - 1])
        del self._input[:size]
        self._execute(command, payload)
        return True

    def _is_plain(self, command: int) -> bool:
        """Whether a command has no payload although its highest bit is set."""
        return command in {self.info_command, self.reset_command, *self.health_commands}

    def _execute(self, command: int, payload: bytes) -> None:
        if command in self.stop_commands:
            self._stream = None
        elif command == self.reset_command:
            self._stream = None
            self._deaf_until_s = self._now_s + RESET_S
            self._send(b"RP LIDAR System.\r\n", RESET_S)
        elif (stream := self.scan_kind(command, payload)) is not None:
            if self.health != 2:  # else "protection stop"
                self._stream = stream
                self._update_motor()
                self._send(self.announcement(stream.kind), ANSWER_S)
        elif self._stream is not None:
            return  # while it scans it obeys nothing else
        elif command == self.info_command:
            info = (self.figures.model, *reversed(self.figures.firmware), self.figures.hardware)
            self._send(reply(INFO_TYPE, bytes(info) + self._serial), ANSWER_S)
        elif command in self.health_commands:
            code = 0x8001 if self.health else 0
            self._send(reply(HEALTH_TYPE, bytes((self.health,)) + code.to_bytes(2, "little")), ANSWER_S)
        elif content := self.answer(command, payload):
            self._send(content, ANSWER_S)

    @abstractmethod
    def announcement(self, kind: int) -> bytes:
        """Return the descriptor that precedes the packets of a scan."""

    def _next_points(self, stream: A5Stream, first_s: float) -> tuple[FloatArray, float]:
        numbers = stream.points + np.arange(self.points_in_packet(stream, first_s), dtype=np.float64)
        last_s = self._time_s(stream, numbers[-1:], first_s)[0]
        return np.asarray(numbers, np.float64), float(last_s + FILTER_POINTS / stream.points_per_s)

    def points_in_packet(self, stream: A5Stream, first_s: float) -> int:
        """Return how many points the next packet has."""
        return self.packet_points

    def _time_s(self, stream: A5Stream, numbers: FloatArray, first_s: float) -> FloatArray:
        return first_s + (numbers + 1.0) / (stream.points_per_s * self._rate)

    def head_deg(self, times_s: FloatArray) -> FloatArray:
        """Return the angle of the head, clockwise and rising for ever."""
        turns_s = times_s
        if not self.figures.has_speed_control:
            turns_s = times_s - WANDER * WANDER_S / math.tau * np.cos(math.tau * times_s / WANDER_S)
        return np.asarray(self._first_deg + 360.0 * self._turns_per_s * turns_s, np.float64)

    def _send_packet(self, stream: A5Stream, numbers: FloatArray, first_s: float) -> None:
        times_s = self._time_s(stream, numbers, first_s)
        head_deg = self.head_deg(times_s)
        rng = np.random.default_rng([self._seed, stream.packets, round(1e3 * first_s)])
        plain = replace(self._beams, conditions=UNDISTURBED)
        angles_deg = head_deg
        for _ in range(2):  # the angle of a point depends on its range, which depends on the angle
            guess_m = plain.cast(times_s, -np.deg2rad(angles_deg), rng)
            guess_m = np.minimum(guess_m, self.figures.range_max_m)
            angles_deg = head_deg + self.turned_deg(guess_m)
        true_m = self._beams.cast(times_s, -np.deg2rad(angles_deg), rng)
        ranges_m = self._measured_m(true_m, rng)
        packet = self.pack(stream.kind, head_deg, angles_deg, ranges_m)
        stream.points += numbers.size
        stream.packets += 1
        after_s = float(times_s[-1]) + FILTER_POINTS / stream.points_per_s - self._now_s
        self._send(packet, after_s, self.burst_bytes(stream.kind, packet))

    def _measured_m(self, true_m: FloatArray, rng: np.random.Generator) -> FloatArray:
        figures = self.figures
        bounded_m = np.minimum(true_m, 2.0 * figures.range_max_m)
        bias_m = self._bias * np.maximum(figures.bias_m, figures.bias_share * bounded_m)
        sigma_m = figures.noise_m + figures.noise_per_m * bounded_m**2
        measured_m = bounded_m + bias_m + sigma_m * rng.standard_normal(true_m.size)
        in_range = (measured_m >= figures.range_min_m) & (true_m <= figures.range_max_m)
        return np.where(in_range, measured_m, 0.0)

    def _send(self, data: bytes, after_s: float, burst_bytes: int | None = None) -> None:
        """Send bytes `after_s` from now; they arrive after the wire and a delay, in the order of sending.

        All but the last `burst_bytes` have been sent before.
        """
        start_s = max(self._now_s + after_s, self._wire_free_s)
        self._wire_free_s = start_s + 10.0 * (burst_bytes or len(data)) / self.baud
        delay_s = 0.0
        if self._delay_s:
            rng = np.random.default_rng([self._seed, round(1e4 * self._wire_free_s), 1])
            delay_s = self._delay_s * float(rng.random())
        self._arrived_s = max(self._arrived_s, self._wire_free_s + delay_s)
        self._outbox.send(data, self._arrived_s)
