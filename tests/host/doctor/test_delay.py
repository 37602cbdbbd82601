"""The doctor measures the true round trip over a delayed link, also beyond 100 ms."""

from collections import deque
from collections.abc import Iterator
from typing import cast

import pytest
import serial

from thumper.board.options import BoardOptions
from thumper.common.serial_port import SerialPort, open_port
from thumper.doctor.board_checks import check_board
from thumper.doctor.check import Check
from thumper.doctor.lidar_checks import check_lidar
from thumper.doctor.verdicts import measure_round_trips
from thumper.lidar.options import LidarOptions

STEP_S = 0.001


class DelayedPort:
    """A simulated port behind a wire with a delay in simulated seconds, each way."""

    port = "delayed"
    baudrate = 500_000

    def __init__(self, port: SerialPort, delay_s: float) -> None:
        self._port, self._delay_s = port.raw, delay_s
        self.clock_s = port.now_s
        self.timeout = 0.02
        self._out: deque[tuple[float, bytes]] = deque()
        self._in: deque[tuple[float, bytes]] = deque()
        self._arrived = bytearray()

    def write(self, data: bytes) -> int:
        self._out.append((self.clock_s() + self._delay_s, bytes(data)))
        return len(data)

    @property
    def in_waiting(self) -> int:
        while self._in and self._in[0][0] <= self.clock_s():
            self._arrived += self._in.popleft()[1]
        return len(self._arrived)

    def read(self, size: int = 1) -> bytes:
        until_s = self.clock_s() + self.timeout
        while self.in_waiting < size and self.clock_s() < until_s:
            while self._out and self._out[0][0] <= self.clock_s():
                self._port.write(self._out.popleft()[1])
            self._port.timeout = STEP_S
            data = self._port.read(max(1, self._port.in_waiting))
            if data:
                self._in.append((self.clock_s() + self._delay_s, data))
        data = bytes(self._arrived[:size])
        del self._arrived[:size]
        return data

    def reset_input_buffer(self) -> None:
        self._arrived.clear()

    def close(self) -> None:
        self._port.close()


@pytest.fixture
def delay_s(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> float:
    """Delay of both ports, each way [s]."""
    delay_s: float = request.param

    def delayed(url: str, *, baud: int, name: str) -> SerialPort:
        return SerialPort(cast("serial.Serial", DelayedPort(open_port(url, baud=baud, name=name), delay_s)))

    for module in ("thumper.doctor.board_checks", "thumper.lidar.open_lidar"):
        monkeypatch.setattr(f"{module}.open_port", delayed)
    return delay_s


def round_trip_line(checks: Iterator[Check], name: str) -> tuple[str, float, str]:
    """Return the verdict, the median [ms] and the whole line."""
    (found,) = [check for check in checks if check.what.startswith(f"{name}: round trip")]
    return found.verdict, float(found.what.split("round trip ")[1].split(" ms")[0]), found.what


@pytest.mark.parametrize(
    ("delay_s", "verdict"),
    [(0.0, "pass"), (0.03, "warn"), (0.06, "warn"), (0.11, "fail")],
    indirect=["delay_s"],
)
def test_the_round_trip_of_the_board_is_measured(delay_s: float, verdict: str) -> None:
    """Twice the delay and the 2 to 4 ms of board and USB; a late reply is not lost."""
    checks = check_board(BoardOptions(port="sim://delay/board"), seconds=1.0, spin=None, also=iter(()))
    found, median_ms, what = round_trip_line(checks, "board")
    assert found == verdict
    assert median_ms == pytest.approx(2e3 * delay_s + 3.0, abs=3.5)
    assert "0 of 50 requests without reply" in what


@pytest.mark.parametrize("delay_s", [0.06], indirect=True)
def test_the_round_trip_of_the_lidar_is_measured(delay_s: float) -> None:
    checks = check_lidar(LidarOptions(port="sim://delay/lidar"), seconds=1.0)
    found, median_ms, what = round_trip_line(checks, "lidar")
    assert found == "warn"
    assert median_ms == pytest.approx(2e3 * delay_s + 3.0, abs=3.5)
    assert "0 of 50 requests without reply" in what


def test_requests_end_if_nobody_answers() -> None:
    """Stop after five lost requests in a row; count single ones."""
    sent = []

    def silent(number: int, timeout_s: float) -> float | None:
        sent.append(number)
        return None

    assert measure_round_trips(silent) == ([], 5)
    assert sent == [0, 1, 2, 3, 4]
    trips_s, lost = measure_round_trips(lambda number, _: None if number % 10 == 3 else 0.001 * number)
    assert (len(trips_s), lost) == (45, 5)
    assert trips_s[-1] == pytest.approx(0.049)
