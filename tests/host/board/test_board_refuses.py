"""Wrong devices and protocol versions are refused in one line that names the port and the fix.

The port is a real one (a pseudo-terminal); at its other end a thread plays the wrong device.
"""

import os
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from thumper.board import board
from thumper.board.board import Board
from thumper.board.framing import encode_frame
from thumper.board.messages import SCHEMA_HASH, Identity
from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.common.serial_port import open_port


@contextmanager
def device(answer: Callable[[bytes], bytes]) -> Iterator[str]:
    """A device on a pseudo-terminal that answers each read with `answer(read)`."""
    far, near = os.openpty()
    tty.setraw(near)
    stop = threading.Event()

    def serve() -> None:
        os.set_blocking(far, False)
        while not stop.wait(0.01):
            try:
                os.write(far, answer(os.read(far, 1000)))
            except BlockingIOError:
                continue

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield os.ttyname(near)
    finally:
        stop.set()
        thread.join()
        os.close(far)
        os.close(near)


def refusal(url: str, exit_code: int = EXIT_NOT_THERE) -> str:
    with pytest.raises(ThumperError) as caught:
        Board.open(url, baud=500_000)
    assert caught.value.exit_code == exit_code
    message = str(caught.value)
    assert "\n" not in message
    assert url in message
    return message


def identity(schema_hash: int) -> bytes:
    return schema_hash.to_bytes(4, "little") + bytes(Identity._LAYOUT.size - 4)


def test_a_missing_port() -> None:
    assert "no such port" in refusal("/dev/ttyNONE9")


def test_an_unknown_kind_of_url() -> None:
    assert "no such kind of port" in refusal("telepathy://robot", exit_code=2)


def test_a_silent_port() -> None:
    with device(lambda _: b"") as url:
        assert "sends nothing" in refusal(url)


def test_a_device_with_another_protocol() -> None:
    with device(lambda _: b"$GPGGA,123519,4807.038,N,01131.000,E*47\r\n") as url:
        assert "not the Thumper protocol" in refusal(url)


@pytest.mark.parametrize("extra", [b"", b"a field more"])
def test_another_protocol_version(extra: bytes) -> None:
    other = SCHEMA_HASH ^ 0x1234
    with device(lambda _: encode_frame(Identity.ID, 0, identity(other) + extra)) as url:
        message = refusal(url)
    assert f"{other:08x}" in message
    assert f"{SCHEMA_HASH:08x}" in message
    assert "flash" in message


def test_a_simulated_board_of_another_version_must_be_built_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(board, "SCHEMA_HASH", SCHEMA_HASH ^ 0x1234)
    with pytest.raises(ThumperError, match="make firmware"):
        Board.open("sim://other/board", baud=500_000)


def test_a_port_that_is_in_use() -> None:
    with device(lambda _: b"") as url:
        first = open_port(url, baud=500_000, name="board")
        try:
            assert "another program has it open" in refusal(url)
        finally:
            first.close()
