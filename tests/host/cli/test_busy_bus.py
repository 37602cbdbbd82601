"""`thumper run` while another robot process holds the bus."""

import socket
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.host.cli.conftest import Ended
from thumper.common.errors import EXIT_NOT_THERE, EXIT_USAGE


@pytest.fixture
def busy() -> Iterator[str]:
    """Return the address of a bus that is in use."""
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        yield f"127.0.0.1:{other.getsockname()[1]}"


@pytest.mark.parametrize(
    ("board", "status", "problem"),
    [
        ("sim://", EXIT_NOT_THERE, "is another robot process running?"),
        ("sim://?world=nowhere", EXIT_USAGE, "nowhere"),
        ("/dev/ttyNONE0", EXIT_NOT_THERE, "there is no such port"),
    ],
)
def test_a_wrong_board_is_named_before_the_busy_bus(
    thumper: Callable[..., Ended], busy: str, tmp_path: Path, board: str, status: int, problem: str
) -> None:
    lidar = [] if board.startswith("sim:") else ["--lidar", "sim://"]
    ended = thumper("run", "--board", board, *lidar, "--bus", busy, "--out", str(tmp_path))
    assert problem in ended.err
    assert ended.status == status
