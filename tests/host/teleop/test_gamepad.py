"""A virtual SDL gamepad: its sticks and buttons, and what happens when it is unplugged."""

import ctypes
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from thumper.common.geometry import Twist2
from thumper.config.robot import RobotConfig
from thumper.ros.from_ros import twist_of
from thumper.teleop.gamepad import Gamepad
from thumper.teleop.keyboard import Action
from thumper.teleop.teleop_loop import TeleopLoop

pytest.importorskip("pygame", reason="pygame is not installed (pip install thumper[gamepad])")
PAD_TYPE, AXES, BUTTONS, HATS = 1, 6, 15, 1
LB, RB, B, X, START = 9, 10, 1, 2, 6
PERIOD_S = 0.05


class VirtualPad:
    """A virtual gamepad, attached to the SDL library that pygame has loaded."""

    def __init__(self) -> None:
        with open("/proc/self/maps", encoding="utf-8") as maps:
            path = next(line.split()[-1] for line in maps if "libSDL2-2" in line)
        self._sdl = ctypes.CDLL(path)
        self._sdl.SDL_JoystickOpen.restype = ctypes.c_void_p
        self._sdl.SDL_JoystickSetVirtualAxis.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_int16]
        self._sdl.SDL_JoystickSetVirtualButton.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_uint8]
        self._index = self._sdl.SDL_JoystickAttachVirtual(PAD_TYPE, AXES, BUTTONS, HATS)
        assert self._index >= 0
        self._pad = self._sdl.SDL_JoystickOpen(self._index)

    def axis(self, number: int, value: int) -> None:
        assert self._sdl.SDL_JoystickSetVirtualAxis(self._pad, number, value) == 0

    def button(self, number: int, down: bool) -> None:
        assert self._sdl.SDL_JoystickSetVirtualButton(self._pad, number, down) == 0

    def unplug(self) -> None:
        assert self._sdl.SDL_JoystickDetachVirtual(self._index) == 0


@pytest.fixture
def gamepad() -> Iterator[Gamepad]:
    pad = Gamepad()
    yield pad
    pad.close()


def test_sticks_and_buttons(gamepad: Gamepad) -> None:
    assert gamepad.poll() is None
    assert gamepad.name == ""
    virtual = VirtualPad()
    virtual.axis(1, -32767)
    virtual.axis(2, 16384)
    virtual.button(LB, True)
    state = gamepad.poll()
    state = gamepad.poll()  # SDL reports the gamepad first and its sticks at the next poll
    assert state is not None
    assert "Virtual" in gamepad.name
    assert state.stick.forward == pytest.approx(1.0)
    assert state.stick.turn == pytest.approx(-0.5, abs=0.01)
    assert state.stick.enable
    assert not state.stick.turbo
    virtual.button(RB, True)
    virtual.button(B, True)
    state = gamepad.poll()
    assert state is not None
    assert state.stick.turbo
    assert state.pressed == (Action.ESTOP,)
    state = gamepad.poll()
    assert state is not None
    assert state.pressed == ()  # held: reported once
    virtual.unplug()
    assert gamepad.poll() is None
    VirtualPad().unplug()


Sent = list[tuple[str, Any]]


@pytest.fixture
def teleop(gamepad: Gamepad) -> tuple[TeleopLoop, Sent, Callable[[bytes], None]]:
    sent: Sent = []
    typed: list[bytes] = []

    def read() -> bytes:
        data = b"".join(typed)
        typed.clear()
        return data

    return (
        TeleopLoop(RobotConfig(), lambda topic, message: sent.append((topic, message)), read, gamepad),
        sent,
        typed.append,
    )


def twists(sent: Sent, topic: str) -> list[Twist2]:
    return [twist_of(message.twist) for name, message in sent if name == topic]


def test_unplugging_sends_one_zero_and_the_button_must_be_released(
    teleop: tuple[TeleopLoop, Sent, Callable[[bytes], None]],
) -> None:
    loop, sent, _ = teleop
    virtual = VirtualPad()
    for k in range(3):
        loop.step(0.1 * k, PERIOD_S)
    assert sent == []  # the deadman button is not pressed
    virtual.axis(1, -32767)
    virtual.button(LB, True)
    for k in range(20):
        loop.step(1.0 + 0.05 * k, PERIOD_S)
    assert twists(sent, "gamepad")[-1].v_m_s == pytest.approx(RobotConfig().teleop.v_max_m_s)
    sent.clear()
    virtual.unplug()
    for k in range(5):
        loop.step(3.0 + 0.05 * k, PERIOD_S)
    assert twists(sent, "gamepad") == [Twist2()]
    sent.clear()
    again = VirtualPad()
    again.axis(1, -32767)
    again.button(LB, True)
    for k in range(5):
        loop.step(4.0 + 0.05 * k, PERIOD_S)
    assert sent == []
    again.button(LB, False)
    loop.step(5.0, PERIOD_S)
    again.button(LB, True)
    loop.step(5.1, PERIOD_S)
    loop.step(5.15, PERIOD_S)
    assert twists(sent, "gamepad")[-1].v_m_s > 0.0
    again.unplug()


def test_a_held_button_overrides_the_assistance(
    teleop: tuple[TeleopLoop, Sent, Callable[[bytes], None]],
) -> None:
    loop, sent, _ = teleop
    virtual = VirtualPad()
    loop.step(0.0, PERIOD_S)
    virtual.axis(1, -32767)
    virtual.button(LB, True)
    for k in range(3):
        loop.step(1.0 + 0.05 * k, PERIOD_S)
    assert "override" not in [topic for topic, _ in sent]
    virtual.button(X, True)
    loop.step(1.2, PERIOD_S)
    loop.step(1.25, PERIOD_S)
    assert [topic for topic, _ in sent[-2:]] == ["override", "gamepad"]
    virtual.unplug()
    loop.step(1.3, PERIOD_S)


def test_a_driver_can_leave_the_assistance_off(gamepad: Gamepad) -> None:
    sent: Sent = []
    keys: list[bytes] = []
    loop = TeleopLoop(
        RobotConfig(),
        lambda topic, message: sent.append((topic, message)),
        lambda: keys.pop() if keys else b"",
        gamepad,
        assisted=False,
    )
    loop.step(0.0, PERIOD_S)  # no key is held at the start
    keys.append(b"i")
    loop.step(1.0, PERIOD_S)
    loop.step(1.05, PERIOD_S)
    assert [topic for topic, _ in sent[-2:]] == ["override", "teleop"]


def test_the_emergency_stop_is_sent_at_once_and_zeros_follow(
    teleop: tuple[TeleopLoop, Sent, Callable[[bytes], None]],
) -> None:
    loop, sent, _ = teleop
    virtual = VirtualPad()
    loop.step(0.0, PERIOD_S)
    virtual.button(LB, True)
    virtual.axis(1, -32767)
    loop.step(0.1, PERIOD_S)
    loop.step(0.15, PERIOD_S)
    sent.clear()
    virtual.button(B, True)
    loop.step(0.2, PERIOD_S)
    assert [topic for topic, _ in sent] == ["estop", "teleop", "gamepad"]
    assert sent[0][1].data is True
    sent.clear()
    loop.step(0.25, PERIOD_S)  # both are still held
    assert sent == []
    virtual.unplug()


def test_the_keyboard_drives_beside_the_gamepad(
    teleop: tuple[TeleopLoop, Sent, Callable[[bytes], None]],
) -> None:
    loop, sent, type_in = teleop
    loop.step(0.0, PERIOD_S)
    type_in(b"i")
    loop.step(0.1, PERIOD_S)
    loop.step(0.5, PERIOD_S)
    loop.step(0.8, PERIOD_S)
    loop.step(0.9, PERIOD_S)
    speeds = [twist.v_m_s for twist in twists(sent, "teleop")]
    assert speeds == pytest.approx([0.075, 0.15, 0.0])  # ramps up, then sends zero once
    type_in(b"r")
    loop.step(1.0, PERIOD_S)
    assert (sent[-1][0], sent[-1][1].data) == ("command", "arm")
    type_in(b"q")
    assert not loop.step(1.1, PERIOD_S)
