"""The page's port: taken before anything is started that would have to be ended again."""

import errno
import socket

from thumper.dashboard.options import Listening
from thumper.errors import ThumperError


def bound(listening: Listening) -> socket.socket:
    """Take the port; closing the socket gives it back.

    Raises
    ------
    ThumperError
        The port is taken.
    """
    family = socket.AF_INET6 if ":" in listening.host else socket.AF_INET
    listener = socket.socket(family)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((listening.host, listening.port))
        listener.listen()  # a browser that is quicker than the page's start waits for it
    except (OSError, socket.gaierror) as error:
        listener.close()
        taken = isinstance(error, OSError) and error.errno == errno.EADDRINUSE
        why = (
            "it is taken; end the program that has it, or take another: [dashboard] port in the "
            "configuration, or --port of `thumper dashboard`, which serves the page beside a robot that runs"
            if taken
            else str(error.strerror)
        )
        raise ThumperError(f"cannot listen on {listening.host}:{listening.port}: {why}") from error
    return listener
