"""Answers browsers while the program of the page loads, which takes seconds on a busy computer."""

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from select import select

POLL_S = 0.1
READ_TIMEOUT_S = 0.2  # browsers open connections in advance and send nothing
MAX_REQUEST_BYTES = 65536
PAGE = b"""<!doctype html><html lang="en"><meta charset="utf-8"><meta http-equiv="refresh" content="1">
<meta name="viewport" content="width=device-width"><meta name="color-scheme" content="light dark">
<title>Thumper</title><body style="font: 16px sans-serif; display: grid; place-items: center; height: 90vh">
<p>The dashboard is starting \xe2\x80\xa6</p>"""
ANSWER = (
    b"HTTP/1.1 503 Service Unavailable\r\nContent-Type: text/html\r\nCache-Control: no-store\r\n"
    b"Connection: close\r\nContent-Length: %d\r\n\r\n%s" % (len(PAGE), PAGE)
)


@contextmanager
def starting_page(listener: socket.socket) -> Iterator[None]:
    """Answer each request on `listener` with a page that loads again every second."""
    ended = threading.Event()
    thread = threading.Thread(target=_answer, args=(listener, ended), name="starting-page", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def _answer(listener: socket.socket, ended: threading.Event) -> None:
    while not ended.is_set():
        if not select([listener], [], [], POLL_S)[0]:
            continue
        with suppress(OSError):
            connection, _ = listener.accept()
            with connection:
                connection.settimeout(READ_TIMEOUT_S)
                if connection.recv(MAX_REQUEST_BYTES):
                    connection.sendall(ANSWER)
