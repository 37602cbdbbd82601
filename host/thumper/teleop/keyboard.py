"""Read the keys of a terminal as a joystick.

A terminal reports that a key is pressed and that it repeats, but not that it is released. So a key press is
valid for a short time only.
"""

from enum import Enum

from thumper.teleop.joystick_curve import JoystickState

FIRST_PRESS_S = 0.6  # a first press is valid for longer than the terminal waits before it repeats the key
REPEAT_S = 0.2  # a repeat is valid for longer than the time between two repeats

ARROWS = {b"A": "i", b"B": ",", b"C": "l", b"D": "j"}
SHIFTED_ARROWS = {b"A": "I", b"B": "<", b"C": "L", b"D": "J"}
DIRECTIONS = {  # forward, turn: the nine keys around k, as in ROS's teleop_twist_keyboard
    "u": (1.0, 0.5),
    "i": (1.0, 0.0),
    "o": (1.0, -0.5),
    "j": (0.0, 1.0),
    "k": (0.0, 0.0),
    "l": (0.0, -1.0),
    "m": (-1.0, -0.5),
    ",": (-1.0, 0.0),
    ".": (-1.0, 0.5),
    "w": (1.0, 0.0),  # and the keys of most games
    "a": (0.0, 1.0),
    "s": (-1.0, 0.0),
    "d": (0.0, -1.0),
}
SHIFTED = {"<": ",", ">": ".", ";": ",", ":": "."}  # the same keys with Shift


class Action(Enum):
    """Actions of keys and buttons other than driving."""

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
    """Tracks the held key, as far as a terminal reports it. Pure: bytes and times come in."""

    def __init__(self) -> None:
        self._key = ""
        self._until_s = 0.0

    def feed(self, data: bytes, now_s: float) -> list[Action]:
        """Process typed bytes; return the actions among them."""
        actions = []
        for key in _split(data):
            if key == "\x1b":
                actions.append(Action.ESTOP)
            elif key in ACTIONS:
                actions.append(ACTIONS[key])
            if SHIFTED.get(key, key.lower()) in DIRECTIONS:
                repeated = key == self._key and now_s < self._until_s
                hold_s = REPEAT_S if repeated else FIRST_PRESS_S
                self._key, self._until_s = key, max(now_s + hold_s, self._until_s if repeated else 0.0)
            else:
                self._key = ""  # any other key releases the held one
        return actions

    def stick(self, now_s: float) -> JoystickState:
        """Return the joystick state of the held key; Shift is turbo."""
        if not self._key or now_s >= self._until_s:
            self._key = ""
            return JoystickState()
        plain = SHIFTED.get(self._key, self._key.lower())
        forward, turn = DIRECTIONS[plain]
        return JoystickState(forward=forward, turn=turn, enable=plain != "k", turbo=plain != self._key)


def _split(data: bytes) -> list[str]:
    """Split bytes to keys: arrow sequences become the letters they stand for, unknown ones are dropped."""
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
