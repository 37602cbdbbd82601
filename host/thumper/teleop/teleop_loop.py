"""The loop of `thumper teleop`: read keyboard and gamepad, publish commands on the bus."""

import time
from collections.abc import Callable
from typing import Protocol

from thumper.common.geometry import Twist2
from thumper.config.robot import RobotConfig
from thumper.ros.codec import Message
from thumper.ros.to_ros import Messages, flag, text
from thumper.teleop.gamepad import GamepadState
from thumper.teleop.joystick_curve import JoystickState, SpeedScaler
from thumper.teleop.keyboard import Action, KeyboardJoystick

COMMANDS = {Action.ARM: "arm", Action.DISARM: "disarm", Action.CLEAR_FAULT: "clear_fault"}


class GamepadSource(Protocol):
    """A gamepad, real or simulated."""

    @property
    def name(self) -> str:
        """Name of the gamepad; empty without one."""
        ...

    def poll(self) -> GamepadState | None:
        """Return its state, or None while none is connected."""
        ...


class TeleopLoop:
    """An operator with a keyboard and an optional gamepad; call `step` `rate_Hz` times per second."""

    def __init__(
        self,
        config: RobotConfig,
        publish: Callable[[str, Message], None],
        read: Callable[[], bytes],
        pad: GamepadSource | None,
        *,
        assisted: bool = True,
    ) -> None:
        """`publish` sends a message to a topic; `read` returns what was typed since the last call.

        Not `assisted`, the robot drives although something is in the way.
        """
        options, limit = config.teleop, config.drive.max_wheel_rad_s
        self._publish, self._read, self._pad = publish, read, pad
        self._assisted = assisted
        self._keys = KeyboardJoystick()
        self._keyboard_scaler = SpeedScaler(options, config.drive, limit)
        self._gamepad_scaler = SpeedScaler(options, config.drive, limit)
        self._messages = Messages()
        self.twist = Twist2()  # last one sent
        self.has_armed = False  # and nothing here has switched the motors off since

    def step(self, now_s: float, period_s: float) -> bool:
        """Read keyboard and gamepad and send their commands; return False if the operator quits."""
        actions = self._keys.feed(self._read(), now_s)
        state = self._pad.poll() if self._pad else None
        if state is not None:
            actions += state.pressed
        if Action.ESTOP in actions:
            self._publish("estop", flag(True))
            self.has_armed = False
            self.release()
            return Action.QUIT not in actions
        for action in actions:
            if action in COMMANDS:
                self._publish("command", text(COMMANDS[action]))
                self.has_armed = action is Action.ARM or (self.has_armed and action is not Action.DISARM)
        sent = self._send("teleop", self._keyboard_scaler, self._keys.stick(now_s), period_s)
        if self._pad is not None:  # last, because the gamepad outranks the keyboard
            sent = (
                self._send("gamepad", self._gamepad_scaler, state.stick if state else None, period_s) or sent
            )
        if sent is not None:
            self.twist = sent
        return Action.QUIT not in actions

    def release(self) -> None:
        """Stop, and ignore every held button until it has been released."""
        for topic, scaler in (("teleop", self._keyboard_scaler), ("gamepad", self._gamepad_scaler)):
            scaler.step(None, 0.0)
            self._publish(topic, self._messages.twist(time.time(), Twist2()))
        self._keys.feed(b"k", 0.0)
        self.twist = Twist2()

    def _send(
        self, topic: str, scaler: SpeedScaler, stick: JoystickState | None, period_s: float
    ) -> Twist2 | None:
        twist = scaler.step(stick, period_s)
        if twist is not None:
            if not self._assisted or (stick is not None and stick.override):
                self._publish("override", flag(True))
            self._publish(topic, self._messages.twist(time.time(), twist))
        return twist
