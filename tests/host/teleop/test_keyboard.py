"""A terminal does not report key releases; each press is valid for a limited time."""

import os
import pty
import tty

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thumper.teleop.joystick_curve import JoystickState
from thumper.teleop.keyboard import FIRST_PRESS_S, Action, KeyboardJoystick
from thumper.teleop.terminal import Terminal


def test_a_press_is_valid_until_it_repeats_and_a_repeat_more_shortly() -> None:
    keys = KeyboardJoystick()
    keys.feed(b"i", 0.0)
    assert keys.stick(0.59).enable
    assert not keys.stick(0.6).enable
    keys.feed(b"i", 1.0)
    for k in range(10):
        keys.feed(b"i", 1.5 + 0.03 * k)
        assert keys.stick(1.5 + 0.03 * k).enable
    assert keys.stick(1.77 + 0.19).enable
    assert not keys.stick(1.77 + 0.2).enable


@pytest.mark.parametrize(
    ("typed", "forward", "turn", "turbo"),
    [
        (b"i", 1, 0, False),
        (b",", -1, 0, False),
        (b"j", 0, 1, False),
        (b"l", 0, -1, False),
        (b"u", 1, 0.5, False),
        (b".", -1, 0.5, False),
        (b"I", 1, 0, True),
        (b"<", -1, 0, True),
        (b"w", 1, 0, False),
        (b"a", 0, 1, False),
        (b"s", -1, 0, False),
        (b"d", 0, -1, False),
        (b"W", 1, 0, True),
        (b"\x1b[A", 1, 0, False),
        (b"\x1bOB", -1, 0, False),
        (b"\x1b[D", 0, 1, False),
        (b"\x1b[1;2C", 0, -1, True),
        (b"\x1b[1;2B", -1, 0, True),
    ],
)
def test_directions(typed: bytes, forward: float, turn: float, turbo: bool) -> None:
    keys = KeyboardJoystick()
    assert keys.feed(typed, 0.0) == []
    assert keys.stick(0.1) == JoystickState(forward=forward, turn=turn, enable=True, turbo=turbo)


@pytest.mark.parametrize(
    ("typed", "action"),
    [
        (b" ", Action.ESTOP),
        (b"\x1b", Action.ESTOP),
        (b"q", Action.QUIT),
        (b"r", Action.ARM),
        (b"f", Action.DISARM),
        (b"c", Action.CLEAR_FAULT),
    ],
)
def test_other_keys_act_and_release(typed: bytes, action: Action) -> None:
    keys = KeyboardJoystick()
    keys.feed(b"i", 0.0)
    assert keys.feed(typed, 0.1) == [action]
    assert not keys.stick(0.1).enable


def test_k_stops() -> None:
    keys = KeyboardJoystick()
    keys.feed(b"i", 0.0)
    keys.feed(b"k", 0.1)
    assert not keys.stick(0.1).enable


@given(data=st.binary(max_size=64))
def test_any_bytes_are_accepted_and_expire(data: bytes) -> None:
    keys = KeyboardJoystick()
    keys.feed(data, 5.0)
    assert not keys.stick(5.0 + FIRST_PRESS_S).enable


def test_the_terminal_returns_single_keys_without_waiting() -> None:
    ours, theirs = pty.openpty()
    tty.setcbreak(theirs)
    terminal = Terminal(theirs)
    assert terminal.read() == b""
    os.write(ours, b"i\x1b[A")
    assert terminal.read() == b"i\x1b[A"
    for handle in (ours, theirs):
        os.close(handle)
