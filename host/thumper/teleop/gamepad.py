"""Gamepads by SDL, which knows the buttons of all common ones; no window is needed."""

import os
from dataclasses import dataclass
from typing import Any

from thumper.common.optional_packages import require_extra
from thumper.teleop.joystick_curve import JoystickState
from thumper.teleop.keyboard import Action

FULL = 32767.0
LEFT_Y, RIGHT_X = 1, 2  # SDL's numbers of the axes, the same for every pad ...
B, BACK, START, LEFT_SHOULDER, RIGHT_SHOULDER = 1, 4, 6, 9, 10  # ... and of the buttons
ACTIONS = {B: Action.ESTOP, START: Action.ARM, BACK: Action.DISARM}

ENVIRONMENT = {
    "SDL_VIDEODRIVER": "dummy",
    "SDL_AUDIODRIVER": "dummy",
    "SDL_NO_SIGNAL_HANDLERS": "1",  # Ctrl-C is ours
    "SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS": "1",  # there is no window to have the focus
    "PYGAME_HIDE_SUPPORT_PROMPT": "1",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class GamepadState:
    """One look at the pad."""

    stick: JoystickState
    pressed: tuple[Action, ...] = ()  # since the look before


class Gamepad:
    """The first pad that is there; it may come and go."""

    def __init__(self) -> None:
        """Start SDL. Raises ThumperError without pygame."""
        for name, value in ENVIRONMENT.items():
            os.environ.setdefault(name, value)
        require_extra("gamepad")
        import pygame
        from pygame._sdl2 import controller

        self._pygame: Any = pygame
        self._sdl: Any = controller
        pygame.display.init()  # SDL's events live there
        pygame.joystick.init()
        controller.init()
        self._pad: Any = None
        self._down: set[int] = set()

    @property
    def name(self) -> str:
        """What the pad calls itself; nothing without one."""
        return "" if self._pad is None else str(self._pad.name)

    def poll(self) -> GamepadState | None:
        """Look at the pad; None while there is none."""
        self._pygame.event.get()
        if self._pad is not None and not self._pad.attached():
            self._pad.quit()
            self._pad, self._down = None, set()
        if self._pad is None and not self._find():
            return None
        down = {button for button in ACTIONS if self._pad.get_button(button)}
        pressed, self._down = down - self._down, down
        return GamepadState(
            stick=JoystickState(
                forward=-self._pad.get_axis(LEFT_Y) / FULL,  # SDL's y points down
                turn=-self._pad.get_axis(RIGHT_X) / FULL,
                enable=bool(self._pad.get_button(LEFT_SHOULDER)),
                turbo=bool(self._pad.get_button(RIGHT_SHOULDER)),
            ),
            pressed=tuple(ACTIONS[button] for button in sorted(pressed)),
        )

    def close(self) -> None:
        """Let go of the pad and of SDL."""
        self._sdl.quit()
        self._pygame.quit()

    def _find(self) -> bool:
        for index in range(self._sdl.get_count()):
            if self._sdl.is_controller(index):
                self._pad = self._sdl.Controller(index)
                return True
        return False
