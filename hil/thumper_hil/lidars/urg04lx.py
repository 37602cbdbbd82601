"""Simulate a Hokuyo URG-04LX-UG01 on simulated time: SCIP 2.0 bytes in and out.

The head turns at 600 rpm from power-on, with the laser on or off. Step 0 of a revolution points to the rear
right (-135 degrees), step 384 ahead. Each beam is measured at its own time, from the robot's pose at that
time. A scan can be read once step 768 is complete and the bytes have been transferred.
"""

import math
from collections.abc import Callable

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper_hil.lidars.beams import UNDISTURBED, BeamConditions, Beams
from thumper_hil.lidars.outbox import Outbox
from thumper_hil.lidars.scip_reply import scan_reply, status_reply, table_reply, time_reply
from thumper_hil.lidars.scip_request import (
    FIXED_SETTINGS,
    LAST_MEASURABLE_STEP,
    MeasureRequest,
    ScipRefusedError,
    fixed_setting_status,
    split_line,
)
from thumper_hil.lidars.urg_noise import RANGE_MAX_MM, RANGE_MIN_MM, CodeArray, device_bias, measure_mm
from thumper_hil.world.echoes import WorldAt

STEPS_PER_TURN = 1024
FRONT_STEP, FIRST_STEP, LAST_STEP = 384, 44, 725
TURN_S = 0.1
ANSWER_S = 0.001
WIRE_S_PER_BYTE = 2e-6  # USB full speed, with its overhead
CLOCK_WRAP_MS = 1 << 24
NOT_MEASURABLE = 19
MAX_REQUEST_CHARS = 64

IDENTITY = {
    "VEND": "Hokuyo Automatic Co.,Ltd.",
    "PROD": "SOKUIKI Sensor URG-04LX-UG01(Simple-URG)",
    "FIRM": "3.4.03(17/Dec./2012)",
    "PROT": "SCIP 2.0",
    "SERI": "H0000000",
}
PARAMETERS = {
    "MODL": "URG-04LX-UG01(Simple-URG)",
    "DMIN": str(RANGE_MIN_MM),
    "DMAX": str(RANGE_MAX_MM),
    "ARES": str(STEPS_PER_TURN),
    "AMIN": str(FIRST_STEP),
    "AMAX": str(LAST_STEP),
    "AFRT": str(FRONT_STEP),
    "SCAN": "600",
}


class Urg04Lx:
    """The lidar. The caller owns the clock: `write` requests, `advance` time, `read` the replies.

    `pose_at(times_s)` takes shape (n,) and returns map_from_base as rows (x_m, y_m, theta_rad), shape (n, 3).
    The lidar calls it with times up to one revolution in the past. The same seed and the same poses give the
    same scans.
    """

    baud = 0  # USB: any

    def __init__(
        self,
        *,
        world: WorldAt,
        pose_at: Callable[[FloatArray], FloatArray],
        base_from_laser: Pose2,
        seed: int,
        turn_s: float = TURN_S,
        conditions: BeamConditions = UNDISTURBED,
    ) -> None:
        self._beams = Beams(
            world=world,
            pose_at=pose_at,
            base_from_laser=base_from_laser,
            range_max_m=1e-3 * RANGE_MAX_MM,
            conditions=conditions.without_mixed_pixels(),  # `measure_mm` mixes as in the log
        )
        self._clock_rate = 1.0 + conditions.clock_drift
        self._delay_s = conditions.delay_s
        self._seed = seed
        self._turn_s = turn_s / self._clock_rate
        rng = np.random.default_rng(seed)
        self._phase_s = float(rng.uniform(0.0, turn_s))
        self._booted_s = -float(rng.uniform(5.0, 500.0))
        self._bias = device_bias(LAST_STEP - FIRST_STEP + 1, rng)
        self._now_s = 0.0
        self._next_turn = 0
        self._line = bytearray()
        self._outbox = Outbox()
        self._wire_free_s = 0.0
        self._laser_on_s = math.inf  # time of switching on
        self._adjusting = False
        self._request: MeasureRequest | None = None
        self._requested_s = 0.0
        self._remaining = 0
        self._turns_to_skip = 0

    def write(self, data: bytes, time_s: float) -> None:
        """Receive bytes from the host at `time_s`, which never decreases."""
        self.advance(time_s)
        for byte in data:
            if byte not in b"\r\n":
                self._line.append(byte)
                del self._line[MAX_REQUEST_CHARS:]
            elif self._line:
                line = bytes(self._line)
                self._line.clear()
                self._answer(line)

    def advance(self, time_s: float) -> None:
        """Advance time and finish the revolutions that end by then."""
        while (done_s := self._turn_start_s(self._next_turn) + self._sweep_s()) <= time_s:
            self._now_s = done_s
            self._finish_turn(self._next_turn)
            self._next_turn += 1
        self._now_s = max(self._now_s, time_s)

    def read(self) -> bytes:
        """Return the bytes that have reached the host."""
        return self._outbox.arrived(self._now_s)

    def _turn_start_s(self, turn: int) -> float:
        return self._phase_s + turn * self._turn_s

    def _sweep_s(self) -> float:
        return self._turn_s * LAST_MEASURABLE_STEP / STEPS_PER_TURN

    def _clock_ms(self, time_s: float) -> int:
        return math.floor(1000.0 * self._clock_rate * (time_s - self._booted_s)) % CLOCK_WRAP_MS

    def _send(self, reply: bytes, delay_s: float) -> None:
        starts_s = max(self._now_s + delay_s, self._wire_free_s)  # one wire: replies keep their order
        self._wire_free_s = starts_s + WIRE_S_PER_BYTE * len(reply)
        self._outbox.send(reply, self._wire_free_s)

    def _answer(self, line: bytes) -> None:
        try:
            reply = self._execute(line)
        except ScipRefusedError as refusal:
            reply = status_reply(line, str(refusal).encode("ascii"))
        if reply is not None:
            self._send(reply, ANSWER_S)

    def _execute(self, line: bytes) -> bytes | None:
        command, parameters, remark = split_line(line)
        if self._adjusting and command not in {b"TM", b"RS"}:
            # "will not accept any other commands": the manual does not say with which status.
            raise ScipRefusedError("0A")
        if command in {b"MD", b"MS", b"GD", b"GS"}:
            return self._measure(line, MeasureRequest.parse(command, parameters, remark))
        if command == b"TM":
            return self._adjust_clock(line, parameters)
        if command == b"SS":
            return status_reply(line, _bit_rate_status(parameters))
        if command in FIXED_SETTINGS:
            return status_reply(line, fixed_setting_status(command, parameters))
        if parameters:
            raise ScipRefusedError("0E")
        return self._execute_plain(line, command)

    def _execute_plain(self, line: bytes, command: bytes) -> bytes:
        """Execute a command without parameters."""
        tables = {b"VV": IDENTITY, b"PP": PARAMETERS, b"II": self._state()}
        if command in tables:
            return table_reply(line, tables[command])
        status = b"00"
        match command:
            case b"BM":
                status = b"02" if self._is_laser_on() else b"00"
                self._switch_laser_on()
            case b"QT":
                self._stop()
            case b"RS":
                self._stop()
                self._adjusting = False
                self._booted_s = self._now_s
            case _:
                raise ScipRefusedError("0E")
        return status_reply(line, status)

    def _state(self) -> dict[str, str]:
        return {
            "MODL": PARAMETERS["MODL"],
            "LASR": "ON" if self._is_laser_on() else "OFF",
            "SCSP": "Initial(600[rpm])",
            "MESM": "IDLE" if self._request is None else "Measuring by Sensitive Mode",
            "SBPS": "USB only",
            "TIME": f"{self._clock_ms(self._now_s):06X}",
            "STAT": "Sensor works well",
        }

    def _is_laser_on(self) -> bool:
        return self._laser_on_s < math.inf

    def _switch_laser_on(self) -> None:
        self._laser_on_s = min(self._laser_on_s, self._now_s)

    def _stop(self) -> None:
        self._request = None
        self._laser_on_s = math.inf

    def _adjust_clock(self, line: bytes, parameters: bytes) -> bytes:
        match parameters:
            case b"0" if not self._adjusting:
                self._stop()
                self._adjusting = True
                return status_reply(line, b"00")
            case b"1" if self._adjusting:
                return time_reply(line, self._clock_ms(self._now_s + ANSWER_S))
            case b"2" if self._adjusting:
                self._adjusting = False
                return status_reply(line, b"00")
        misuse = {b"0": "02", b"2": "03", b"1": "04"}
        raise ScipRefusedError(misuse.get(parameters, "01" if parameters else "0C"))

    def _measure(self, line: bytes, request: MeasureRequest) -> bytes | None:
        if request.streams:
            self._switch_laser_on()
        elif not self._is_laser_on():
            raise ScipRefusedError("10")
        self._request = request
        self._requested_s = self._now_s if request.streams else self._laser_on_s
        self._remaining = request.count
        self._turns_to_skip = 0
        return status_reply(line, b"00") if request.streams else None

    def _finish_turn(self, turn: int) -> None:
        request, start_s = self._request, self._turn_start_s(turn)
        if request is None or start_s < max(self._requested_s, self._laser_on_s):
            return
        if self._turns_to_skip > 0:
            self._turns_to_skip -= 1
            return
        self._turns_to_skip = request.skip
        if request.count:
            self._remaining -= 1
            if self._remaining == 0:
                self._request = None
                if request.streams:
                    self._laser_on_s = math.inf  # the laser goes off after the last requested scan
        values = _cluster(self._scan(turn)[request.first_step : request.last_step + 1], request.cluster)
        status = b"99" if request.streams else b"00"
        echo = request.echo(self._remaining)
        delay_s = self._delay_s * float(np.random.default_rng([self._seed, turn, 1]).random())
        self._send(scan_reply(echo, status, self._clock_ms(start_s), values, request.chars), delay_s)

    def _scan(self, turn: int) -> CodeArray:
        """Measure one revolution; return the reported values [mm or error code] of steps 0...768."""
        steps = np.arange(FIRST_STEP, LAST_STEP + 1)
        times_s = self._turn_start_s(turn) + steps * self._turn_s / STEPS_PER_TURN
        bearings_rad = (steps - FRONT_STEP) * math.tau / STEPS_PER_TURN
        true_m = self._beams.cast(times_s, bearings_rad, np.random.default_rng([self._seed, turn, 2]))
        values = np.full(LAST_MEASURABLE_STEP + 1, NOT_MEASURABLE, np.int32)
        rng = np.random.default_rng([self._seed, turn])
        values[FIRST_STEP : LAST_STEP + 1] = measure_mm(true_m, self._bias, rng)
        return values


def _cluster(values: CodeArray, size: int) -> CodeArray:
    """Return the smallest valid range of each cluster of beams, or its smallest code if none is valid."""
    if size <= 1:
        return values
    ranked = np.where(values >= RANGE_MIN_MM, values, values + CLOCK_WRAP_MS)  # sort codes after all ranges
    least = np.minimum.reduceat(ranked, np.arange(0, values.size, size))
    return np.where(least >= CLOCK_WRAP_MS, least - CLOCK_WRAP_MS, least).astype(np.int32)


def _bit_rate_status(parameters: bytes) -> bytes:
    if len(parameters) < 6:
        return b"0C"
    if not parameters.isdigit():
        return b"01"
    return b"04"  # a USB device has no bit rate
