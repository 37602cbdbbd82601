"""A bare board on a pseudo-terminal in real time, which starts anew whenever somebody opens its port."""

import os
import select
import termios
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from thumper_hil.chip.chip import CPU_HZ
from thumper_hil.chip.instrumented_chip import InstrumentedChip

STEP_S = 0.001
MOST_BEHIND_S = 0.2  # a machine that was busy does not race after the clock on the wall
CHUNK_BYTES = 4096
BAUD_OF_SPEED = {
    getattr(termios, name): int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit()
}
"""Of the constants in a terminal's settings."""


@contextmanager
def on_pty(chip: InstrumentedChip) -> Iterator[Path]:
    """Serve the chip's serial port at the path that this yields, from a thread, until the block ends.

    As on a Nano, whose DTR line pulls the reset pin, the chip is reset each time the port is opened. Bytes
    cross unharmed only at the chip's own rate: the terminal's is read from the client's settings.
    """
    master, slave = os.openpty()
    tty.setraw(slave, termios.TCSANOW)
    path = Path(os.ttyname(slave))
    os.close(slave)  # nobody has the port open: the master sees a hang-up
    os.set_blocking(master, False)
    stop = threading.Event()
    thread = threading.Thread(target=_serve, args=(chip, master, stop), daemon=True)
    thread.start()
    try:
        yield path
    finally:
        stop.set()
        thread.join()
        os.close(master)


def _serve(chip: InstrumentedChip, master: int, stop: threading.Event) -> None:
    poll = select.poll()
    poll.register(master, select.POLLIN)
    is_open = False
    behind_s = time.monotonic() - chip.time_s
    while not stop.is_set():
        events = dict(poll.poll(0)).get(master, 0)
        was_open, is_open = is_open, not events & select.POLLHUP
        if is_open and not was_open:
            chip.reset()
        if is_open:
            chip.set_host_baud(BAUD_OF_SPEED[termios.tcgetattr(master)[5]])
            if events & select.POLLIN:
                chip.send(os.read(master, CHUNK_BYTES))
        now_s = time.monotonic() - behind_s
        if now_s - chip.time_s > MOST_BEHIND_S:
            behind_s += now_s - chip.time_s - MOST_BEHIND_S
            now_s = chip.time_s + MOST_BEHIND_S
        chip.run(round(now_s * CPU_HZ))
        data = chip.receive(CHUNK_BYTES)
        if is_open and data:
            _write(master, data)
        time.sleep(STEP_S)


def _write(master: int, data: bytes) -> None:
    with suppress(BlockingIOError):  # nobody reads and the terminal is full: lost, as on a wire
        os.write(master, data)
