"""A browser that comes while the page's program loads gets an answer at once."""

import socket
from urllib.error import HTTPError
from urllib.request import urlopen

import pytest

from thumper.dashboard.starting_page import starting_page


def test_a_browser_is_told_that_the_page_starts_and_the_port_stays_open() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        with (
            starting_page(listener),
            socket.create_connection(("127.0.0.1", port)),  # opened in advance, sends nothing
            pytest.raises(HTTPError, match="503") as answer,
        ):
            urlopen(f"http://127.0.0.1:{port}/", timeout=10.0)
        text = answer.value.read().decode()
        assert "is starting" in text
        assert 'http-equiv="refresh"' in text
        socket.create_connection(("127.0.0.1", port)).close()  # waits for the program
