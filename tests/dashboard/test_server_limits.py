"""The page's server under visits, silence and junk: memory, places and log stay bounded."""

import http.client
import re
import socket
import time
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path

import pytest
from benchmarks.shared.browser import Server
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.sync.client import ClientConnection, connect

from thumper.dashboard.connections import MAX_PAGES, SILENT_S
from thumper.dashboard.server_limits import REQUEST_TIMEOUT_S

TIMEOUT_S = 60.0
SOCKET_IO = "/_nicegui_ws/socket.io/?EIO=4&transport=websocket"
HEARTBEAT = '{"kind": "heartbeat", "n": 1}'


def visit(server: Server) -> int:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=TIMEOUT_S)
    connection.request("GET", "/", headers={"Host": f"localhost:{server.port}"})
    answer = connection.getresponse()
    answer.read()
    connection.close()
    return answer.status


def resident_MB(server: Server) -> float:
    status = Path(f"/proc/{server.process.pid}/status").read_text(encoding="ascii")
    return float(re.findall(r"VmRSS:\s+(\d+) kB", status)[0]) / 1000.0


def stream(server: Server) -> AbstractContextManager[ClientConnection]:
    # A client that does not read gets no answer when it closes.
    return connect(f"ws://127.0.0.1:{server.port}/stream", open_timeout=TIMEOUT_S, close_timeout=0.1)


def read_until_closed(connection: socket.socket) -> None:
    while connection.recv(4096):
        pass  # an answer that the request is malformed


def log_of(server: Server) -> str:
    return server._log.read_text(encoding="utf-8")


@pytest.mark.slow
def test_visits_that_never_connect_do_not_fill_the_memory(server: Server) -> None:
    for _ in range(20):
        assert visit(server) == 200
    before_MB = resident_MB(server)
    for _ in range(40):
        assert visit(server) == 200
    assert resident_MB(server) - before_MB < 12.0  # 30 MB if each page stayed


def test_junk_writes_at_most_a_line_per_second(server: Server) -> None:
    visit(server)
    before = len(log_of(server).splitlines())
    started_s = time.monotonic()
    with connect(f"ws://127.0.0.1:{server.port}{SOCKET_IO}", open_timeout=TIMEOUT_S) as client:
        client.recv(TIMEOUT_S)
        client.send("40")
        client.recv(TIMEOUT_S)
        for _ in range(20):
            for event in ('["event",{"x":1}]', '["handshake",1]', '["javascript_response",{}]', '["log",[]]'):
                client.send(f"42{event}")
    time.sleep(1.0)
    lines = log_of(server).splitlines()[before:]
    assert 1 <= len(lines) <= 6 + time.monotonic() - started_s
    assert all(line.startswith("thumper: dashboard: ") for line in lines)
    assert visit(server) == 200


def test_binary_message_closes_its_connection_without_a_traceback(server: Server) -> None:
    before = log_of(server)
    with stream(server) as client:
        client.send(b"\x00\x01")
        with pytest.raises(ConnectionClosed, match="1003"):
            list(client)  # reads until the server closes
    assert log_of(server) == before


def test_connections_without_a_request_are_closed(server: Server) -> None:
    visit(server)
    with ExitStack() as stack:
        started_s = time.monotonic()
        for start in (b"", b"GET / HTTP/1.1\r\nHost: loc"):
            silent = stack.enter_context(socket.create_connection(("127.0.0.1", server.port), TIMEOUT_S))
            silent.sendall(start)
            stack.callback(read_until_closed, silent)
    assert time.monotonic() - started_s > 0.5 * REQUEST_TIMEOUT_S


@pytest.mark.parametrize(
    "start", ["GET /pa", "POST /logout HTTP/1.1\r\nHost: localhost:{port}\r\nContent-Length: 9\r\n\r\n"]
)
def test_connections_whose_later_request_does_not_end_are_closed(server: Server, start: str) -> None:
    whole = f"GET /pages HTTP/1.1\r\nHost: localhost:{server.port}\r\n\r\n"
    with socket.create_connection(("127.0.0.1", server.port), TIMEOUT_S) as slow:
        slow.sendall(whole.encode())
        assert slow.recv(4096).startswith(b"HTTP/1.1 200")
        slow.sendall(start.format(port=server.port).encode())
        read_until_closed(slow)


def test_silent_pages_make_room_for_a_visitor(server: Server) -> None:
    with ExitStack() as stack:
        silent = [stack.enter_context(stream(server)) for _ in range(MAX_PAGES)]
        with pytest.raises(InvalidHandshake), stream(server):  # they may still be new pages
            pass
        time.sleep(SILENT_S + 0.5)
        silent[0].send(HEARTBEAT)  # the oldest is no longer the one that is silent the longest
        while "beat" not in str(silent[0].recv(TIMEOUT_S))[:20]:
            pass
        with stream(server) as visitor:
            assert '"hello"' in str(visitor.recv(TIMEOUT_S))
            silent[0].send(HEARTBEAT)  # still open
