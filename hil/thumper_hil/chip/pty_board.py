"""Serve a bare board on a pseudo-terminal in real time; opening its port resets it."""

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
MAX_LAG_S = 0.2  # beyond this lag the simulation does not catch up with real time
CHUNK_BYTES = 4096
BAUD_BY_SPEED = {
    getattr(termios, name): int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit()
}
"""Baud rate of each speed constant in a terminal's settings."""


@contextmanager
def on_pty(chip: InstrumentedChip) -> Iterator[Path]:
    """Yield the path of a terminal that serves the chip's serial port, from a thread, inside the block.

    Opening the port resets the chip, as on a Nano whose DTR line pulls the reset pin. Bytes arrive intact
    only if the client has set the chip's baud rate.
    """
    master, slave = os.openpty()
    tty.setraw(slave, termios.TCSANOW)
    path = Path(os.ttyname(slave))
    os.close(slave)  # while no client has the port open, the master sees a hang-up
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
    offset_s = time.monotonic() - chip.time_s
    while not stop.is_set():
        events = dict(poll.poll(0)).get(master, 0)
        was_open, is_open = is_open, not events & select.POLLHUP
        if is_open and not was_open:
            chip.reset()
        if is_open:
            chip.set_host_baud(BAUD_BY_SPEED[termios.tcgetattr(master)[5]])
            if events & select.POLLIN:
                chip.send(os.read(master, CHUNK_BYTES))
        now_s = time.monotonic() - offset_s
        if now_s - chip.time_s > MAX_LAG_S:
            offset_s += now_s - chip.time_s - MAX_LAG_S
            now_s = chip.time_s + MAX_LAG_S
        chip.run(round(now_s * CPU_HZ))
        data = chip.receive(CHUNK_BYTES)
        if is_open and data:
            _write(master, data)
        time.sleep(STEP_S)


def _write(master: int, data: bytes) -> None:
    with suppress(
        BlockingIOError
    ):  # no client reads and the buffer is full: the bytes are lost, as on a wire
        os.write(master, data)
