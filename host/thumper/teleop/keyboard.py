"""KeyboardJoystick of a terminal as a stick. Pure: bytes and times come in.

A terminal tells when a key is pressed and that it repeats, never that it is let go: a key holds for a moment.
"""

import os
import select
import sys
import termios
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from enum import Enum

from thumper.config.teleop import TeleopOptions
from thumper.teleop.joystick_curve import JoystickState

MOST_BYTES = 1024


class Terminal:
    """What was typed since the last look."""

    def __init__(self, handle: int) -> None:
        self._handle = handle

    def read(self) -> bytes:
        """Return it; nothing when nothing was typed."""
        ready, _, _ = select.select([self._handle], [], [], 0.0)
        return os.read(self._handle, MOST_BYTES) if ready else b""


@contextmanager
def raw_terminal() -> Iterator[Terminal | None]:
    """Give the terminal, key by key, as long as it lasts; None when standard input is none."""
    if not sys.stdin.isatty():
        yield None
        return
    handle = sys.stdin.fileno()
    before = termios.tcgetattr(handle)
    try:
        tty.setcbreak(handle)
        yield Terminal(handle)
    finally:
        termios.tcsetattr(handle, termios.TCSADRAIN, before)


ARROWS = {b"A": "i", b"B": ",", b"C": "l", b"D": "j"}
SHIFTED_ARROWS = {b"A": "I", b"B": "<", b"C": "L", b"D": "J"}
DIRECTIONS = {  # forward, turn: the nine keys about k, as ROS's keyboard teleop has them
    "u": (1.0, 0.5),
    "i": (1.0, 0.0),
    "o": (1.0, -0.5),
    "j": (0.0, 1.0),
    "k": (0.0, 0.0),
    "l": (0.0, -1.0),
    "m": (-1.0, -0.5),
    ",": (-1.0, 0.0),
    ".": (-1.0, 0.5),
}
SHIFTED = {"<": ",", ">": ".", ";": ",", ":": "."}  # what Shift makes of two of them


class Action(Enum):
    """What a key does besides driving."""

    ESTOP = "e-stop"
    ARM = "arm"
    DISARM = "disarm"
    CLEAR_FAULT = "clear fault"
    QUIT = "quit"


ACTIONS = {
    " ": Action.ESTOP,
    "r": Action.ARM,
    "f": Action.DISARM,
    "c": Action.CLEAR_FAULT,
    "q": Action.QUIT,
    "\x03": Action.QUIT,
}


class KeyboardJoystick:
    """Remembers which key is held, as far as a terminal lets one know."""

    def __init__(self, options: TeleopOptions) -> None:
        self._options = options
        self._key = ""
        self._until_s = 0.0

    def feed(self, data: bytes, now_s: float) -> list[Action]:
        """Take what the terminal gave; returns what else is to be done."""
        actions = []
        for key in _split(data):
            if key == "\x1b":
                actions.append(Action.ESTOP)
            elif key in ACTIONS:
                actions.append(ACTIONS[key])
            if SHIFTED.get(key, key.lower()) in DIRECTIONS:
                repeated = key == self._key and now_s < self._until_s
                hold_s = self._options.key_repeat_s if repeated else self._options.key_first_s
                self._key, self._until_s = key, max(now_s + hold_s, self._until_s if repeated else 0.0)
            else:
                self._key = ""  # any other key lets go
        return actions

    def stick(self, now_s: float) -> JoystickState:
        """What the keys say now; Shift is turbo."""
        if not self._key or now_s >= self._until_s:
            self._key = ""
            return JoystickState()
        plain = SHIFTED.get(self._key, self._key.lower())
        forward, turn = DIRECTIONS[plain]
        return JoystickState(forward=forward, turn=turn, enable=plain != "k", turbo=plain != self._key)


def _split(data: bytes) -> list[str]:
    """Characters, with the arrow keys' sequences as the letters they stand for; unknown sequences vanish."""
    keys = []
    while data:
        if data[:2] in (b"\x1b[", b"\x1bO"):
            end = 2
            while end < len(data) and not 0x40 <= data[end] <= 0x7E:
                end += 1
            final = data[end : end + 1]
            if final in ARROWS:
                keys.append((SHIFTED_ARROWS if b";2" in data[2:end] else ARROWS)[final])
            data = data[end + 1 :]
        else:
            keys.append(chr(data[0]))
            data = data[1:]
    return keys
