"""Start of the URG-04LX driver without a lidar, with a wrong device, and with quirky units."""

from collections.abc import Callable
from typing import cast

import pytest
import serial

from thumper.common.errors import ThumperError
from thumper.common.serial_port import SerialPort
from thumper.lidar.scip import checksum
from thumper.lidar.urg04lx import Urg04LxDriver

Answer = Callable[[bytes], bytes]


class ScriptedPort:
    """Answers each line by a function; its clock runs while the host waits."""

    port = "/dev/ttyACM7"

    def __init__(self, answer: Answer) -> None:
        self._answer = answer
        self._buffer = b""
        self.timeout = 0.02
        self.time_s = 100.0
        self.lines: list[bytes] = []

    def clock_s(self) -> float:
        return self.time_s

    def write(self, data: bytes) -> int:
        for line in data.split(b"\n"):
            if line:
                self.lines.append(line)
                self._buffer += self._answer(line)
        return len(data)

    @property
    def in_waiting(self) -> int:
        return len(self._buffer)

    def read(self, size: int) -> bytes:
        if not self._buffer:
            self.time_s += self.timeout
        data, self._buffer = self._buffer[:size], self._buffer[size:]
        return data

    def close(self) -> None: ...


def status(line: bytes, code: bytes) -> bytes:
    return line + b"\n" + code + bytes([checksum(code)]) + b"\n\n"


def table(line: bytes, *rows: str) -> bytes:
    lines = [row.encode() + b";" + bytes([checksum(row.encode())]) + b"\n" for row in rows]
    return line + b"\n00P\n" + b"".join(lines) + b"\n"


PARAMETERS = ("DMAX:5600", "ARES:1024", "AMIN:44", "AMAX:725", "AFRT:384", "SCAN:600")


def plain_lidar(line: bytes) -> bytes:
    match line:
        case b"PP":
            return table(line, *PARAMETERS)
        case b"VV":
            return table(line, "PROT:SCIP 2.0", "SERI:H0123456")
        case b"SCIP2.0":
            return status(line, b"0E")
        case b"TM1":
            return b"TM1\n00P\n0001a\n\n"
    return status(line, b"00")


def start(answer: Answer) -> tuple[ScriptedPort, Urg04LxDriver]:
    port = ScriptedPort(answer)
    return port, Urg04LxDriver(SerialPort(cast("serial.Serial", port)))


def refusal(answer: Answer) -> str:
    with pytest.raises(ThumperError) as caught:
        start(answer)
    assert caught.value.exit_code == 3
    text = str(caught.value)
    assert "/dev/ttyACM7" in text
    assert "\n" not in text
    return text


def test_no_answer() -> None:
    assert "no lidar answers" in refusal(lambda _: b"")


def test_another_device() -> None:
    assert "not a SCIP 2.0 lidar" in refusal(lambda _: b"\x00\x81\x07telemetry\x00\n\n")


def test_a_refused_laser_is_reported_with_its_status() -> None:
    assert "status 51" in refusal(lambda line: status(line, b"51") if line == b"BM" else plain_lidar(line))


def test_a_device_unplugged_during_the_start_is_one_line() -> None:
    class UnpluggedPort(ScriptedPort):
        @property
        def in_waiting(self) -> int:
            raise OSError("input/output error")  # not wrapped by pyserial

    with pytest.raises(ThumperError, match="cable loose") as caught:
        Urg04LxDriver(SerialPort(cast("serial.Serial", UnpluggedPort(plain_lidar))))
    assert caught.value.exit_code == 3


def test_without_parameters_the_start_fails() -> None:
    text = refusal(lambda line: table(line, "AMIN:44", "SCAN:0") if line == b"PP" else plain_lidar(line))
    assert "PP" in text


def test_the_start_requests_the_identity_once_and_the_stream_last() -> None:
    port, driver = start(plain_lidar)
    assert port.lines[0] == b"QT"
    assert port.lines[-1] == b"MD0044072501000"
    assert port.lines.count(b"VV") == 1
    assert driver.identity["SERI"] == "H0123456"
    assert (driver.geometry.beams, driver.geometry.revolution_s) == (682, 0.1)


@pytest.mark.parametrize(
    "odd",
    [
        pytest.param(lambda line: b"" if line == b"VV" else plain_lidar(line), id="mute on VV"),
        pytest.param(
            lambda line: b"VV\n00P\nSERI:\x07\nH01;?\n\n" if line == b"VV" else plain_lidar(line),
            id="mangled VV",
        ),
        pytest.param(
            lambda line: status(line, b"02") if line == b"BM" else plain_lidar(line), id="already lit"
        ),
        pytest.param(
            lambda line: status(line, b"0E") if line.startswith(b"TM") else plain_lidar(line), id="no TM"
        ),
        pytest.param(lambda line: b"" if line.startswith(b"TM") else plain_lidar(line), id="mute on TM"),
    ],
)
def test_field_quirks_do_not_stop_the_start(odd: Answer) -> None:
    port, _ = start(odd)
    assert port.lines[-1] == b"MD0044072501000"


def test_an_old_unit_is_switched_to_scip_2() -> None:
    """SCIP 1.1 answers an unknown request with an echo and E."""
    switched = False

    def old(line: bytes) -> bytes:
        nonlocal switched
        switched = switched or line == b"SCIP2.0"
        return plain_lidar(line) if switched else line[:1] + b"\nE\n\n"

    port, _ = start(old)
    assert port.lines[-1] == b"MD0044072501000"


def test_damaged_parameters_are_requested_again() -> None:
    requests = 0

    def noisy(line: bytes) -> bytes:
        nonlocal requests
        if line != b"PP":
            return plain_lidar(line)
        requests += 1
        return plain_lidar(line).replace(b"AMAX:725", b"AMAX:729") if requests == 1 else plain_lidar(line)

    _, driver = start(noisy)
    assert driver.geometry.last_step == 725
