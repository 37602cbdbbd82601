"""One line of a terminal that shows the newest state; without a terminal, a plain line every few seconds."""

import shutil
import sys
import time

PLAIN_PERIOD_S = 5.0


class StatusLine:
    """Shows one state after another on stdout."""

    def __init__(self) -> None:
        self._is_terminal = sys.stdout.isatty()
        self._next_plain_s = 0.0

    def show(self, text: str) -> None:
        """Replace the line on a terminal; print it elsewhere if the last one is old enough."""
        now_s = time.monotonic()
        if self._is_terminal:
            print(one_row(text), end="", flush=True)
        elif now_s >= self._next_plain_s:
            self._next_plain_s = now_s + PLAIN_PERIOD_S
            print(text, flush=True)

    def clear(self) -> None:
        """Remove the line from a terminal."""
        if self._is_terminal:
            print(one_row(""), end="", flush=True)


def one_row(line: str) -> str:
    """Return the text that overwrites the terminal's row; a longer line would scroll it."""
    return f"\r\033[K{line[: shutil.get_terminal_size().columns - 1]}"
