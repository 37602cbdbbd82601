"""Use the pseudo-terminals from another process like hardware: plain pyserial on a device path."""

import os
import signal
import stat
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import serial
from benchmarks.shared.live import END_WITH_PARENT

from thumper.board.framing import FrameDecoder, encode_frame
from thumper.board.messages import Identify, Identity, Telemetry
from thumper.common.errors import ThumperError
from thumper_hil.bench.pty import LONGEST_STEP_S, PacedClock, serve

SERVE = """
import sys
from pathlib import Path
from thumper_hil.bench.pty import serve
serve(Path(sys.argv[1]), Path(sys.argv[2]), {})
"""
TIMEOUT_S = 30.0


class Served:
    """A server process and its two paths."""

    def __init__(self, folder: Path) -> None:
        self.board, self.lidar = folder / "board", folder / "lidar"
        self.process = subprocess.Popen(
            [*END_WITH_PARENT, sys.executable, "-c", SERVE, str(self.board), str(self.lidar)],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout is not None
        assert "Press Ctrl-C to stop" in self.process.stdout.readline()

    def stop(self) -> int:
        self.process.send_signal(signal.SIGINT)
        self.process.communicate(timeout=TIMEOUT_S)
        return self.process.returncode


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    """Serve a simulated robot on pseudo-terminals in another process."""
    server = Served(tmp_path)
    yield server
    if server.process.poll() is None:
        server.stop()


def messages(port: serial.Serial, wanted: set[int]) -> set[int]:
    """Read until a complete message of each of these ids has arrived."""
    decoder, seen = FrameDecoder(), set[int]()
    deadline = time.monotonic() + TIMEOUT_S
    while not wanted <= seen and time.monotonic() < deadline:
        seen |= {frame.message_id for frame in decoder.feed(port.read(max(1, port.in_waiting)))}
    return seen


def test_board_and_lidar_answer_on_their_ports(served: Served) -> None:
    """Handshake, telemetry and lidar identity work, and again after the client reconnects."""
    for _ in range(2):
        with serial.Serial(str(served.board), 500_000, timeout=0.2, exclusive=True) as port:
            port.write(b"\0" + encode_frame(Identify.ID, 1, b""))
            assert {Identity.ID, Telemetry.ID} <= messages(port, {Identity.ID, Telemetry.ID})
        with serial.Serial(str(served.lidar), 115_200, timeout=5.0) as port:
            port.write(b"VV\n")
            assert port.read_until(b"\n\n").startswith(b"VV\n00P\nVEND:Hokuyo")
    assert served.stop() == 0
    assert not served.board.is_symlink()
    assert not served.lidar.is_symlink()


@pytest.mark.slow
def test_wrong_baud_rate_gives_garbage(served: Served) -> None:
    with serial.Serial(str(served.board), 115_200, timeout=0.5) as port:
        decoder = FrameDecoder()
        assert decoder.feed(port.read(300)) == []
        port.baudrate = 500_000
        assert Telemetry.ID in messages(port, {Telemetry.ID})


def test_terminals_are_raw_from_the_start(served: Served) -> None:
    """A program that configures nothing must get every byte unchanged, and no echo."""
    for path in (served.board, served.lidar):
        end = os.open(path, os.O_RDWR | os.O_NOCTTY)
        iflag, oflag, _, lflag, *_ = termios.tcgetattr(end)
        os.close(end)
        assert lflag & (termios.ECHO | termios.ICANON | termios.ISIG | termios.IEXTEN) == 0
        assert iflag & (termios.ICRNL | termios.IXON | termios.ISTRIP) == 0
        assert oflag & termios.OPOST == 0
        assert stat.S_ISCHR(path.stat().st_mode)


def test_clock_does_not_catch_up_after_a_delay() -> None:
    clock = PacedClock(1000.0, 0.05)
    assert clock.due_s(1000.002, 0.05) == pytest.approx(0.052)
    assert clock.due_s(1000.602, 0.052) == pytest.approx(0.052 + LONGEST_STEP_S)
    assert clock.due_s(1000.604, 0.152) == pytest.approx(0.154)  # real time again


def test_existing_file_is_not_overwritten(tmp_path: Path) -> None:
    existing = tmp_path / "existing"
    existing.write_text("content")
    with pytest.raises(ThumperError, match="existing"):
        serve(tmp_path / "board", existing, {})
    assert existing.read_text() == "content"
    assert not (tmp_path / "board").is_symlink()


def test_missing_folder_is_reported(tmp_path: Path) -> None:
    with pytest.raises(ThumperError, match="cannot create the link"):
        serve(tmp_path / "nowhere" / "board", tmp_path / "lidar", {})
