"""Gamepads through SDL, which knows the buttons of all common models and needs no window."""

import os
from dataclasses import dataclass
from typing import Any

from thumper.common.optional_packages import require_extra
from thumper.teleop.joystick_curve import JoystickState
from thumper.teleop.keyboard import Action

FULL = 32767.0
LEFT_Y, RIGHT_X = 1, 2  # SDL's numbers of the axes, the same for every model ...
B, X, BACK, START, LEFT_SHOULDER, RIGHT_SHOULDER = 1, 2, 4, 6, 9, 10  # ... and of the buttons
ACTIONS = {B: Action.ESTOP, START: Action.ARM, BACK: Action.DISARM}

ENVIRONMENT = {
    "SDL_VIDEODRIVER": "dummy",
    "SDL_AUDIODRIVER": "dummy",
    "SDL_NO_SIGNAL_HANDLERS": "1",  # thumper handles Ctrl-C
    "SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS": "1",  # no window can have the focus
    "PYGAME_HIDE_SUPPORT_PROMPT": "1",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class GamepadState:
    """State of the gamepad at one poll."""

    stick: JoystickState
    pressed: tuple[Action, ...] = ()  # since the previous poll


class Gamepad:
    """The first connected gamepad. It may be unplugged and plugged in again."""

    def __init__(self) -> None:
        """Start SDL; raise ThumperError if pygame is not installed."""
        for name, value in ENVIRONMENT.items():
            os.environ.setdefault(name, value)
        require_extra("gamepad")
        import pygame
        from pygame._sdl2 import controller

        self._pygame: Any = pygame
        self._sdl: Any = controller
        pygame.display.init()  # SDL's event queue needs it
        pygame.joystick.init()
        controller.init()
        self._pad: Any = None
        self._held: set[int] = set()

    @property
    def name(self) -> str:
        """Name of the gamepad; empty without one."""
        return "" if self._pad is None else str(self._pad.name)

    def poll(self) -> GamepadState | None:
        """Return the state of the gamepad, or None while none is connected."""
        self._pygame.event.get()
        if self._pad is not None and not self._pad.attached():
            self._pad.quit()
            self._pad, self._held = None, set()
        if self._pad is None and not self._find():
            return None
        held = {button for button in ACTIONS if self._pad.get_button(button)}
        pressed, self._held = held - self._held, held
        return GamepadState(
            stick=JoystickState(
                forward=-self._pad.get_axis(LEFT_Y) / FULL,  # SDL's y points down
                turn=-self._pad.get_axis(RIGHT_X) / FULL,
                enable=bool(self._pad.get_button(LEFT_SHOULDER)),
                turbo=bool(self._pad.get_button(RIGHT_SHOULDER)),
                override=bool(self._pad.get_button(X)),
            ),
            pressed=tuple(ACTIONS[button] for button in sorted(pressed)),
        )

    def close(self) -> None:
        """Shut SDL down."""
        self._sdl.quit()
        self._pygame.quit()

    def _find(self) -> bool:
        """Open the first gamepad; return whether there is one."""
        for index in range(self._sdl.get_count()):
            if self._sdl.is_controller(index):
                self._pad = self._sdl.Controller(index)
                return True
        return False
