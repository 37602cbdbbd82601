"""Sliders and numbers for the board's parameters: changed here, then applied, reverted or saved together."""

import asyncio
from collections.abc import Callable
from functools import partial
from html import escape
from typing import Any

from nicegui import ui

from thumper.common.errors import ThumperError
from thumper.dashboard.board_parameters import DOCS, Parameter, Parameters
from thumper.dashboard.widgets import box, button

SHOWN_DIGITS = 3
RETRY_S = 2.0  # the robot may come later than the page


class GainsPanel:
    """One page's panel."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._known: dict[str, Parameter] = {}
        self._on_board: dict[str, float] = {}
        self._wanted: dict[str, Any] = {}
        self._numbers: dict[str, ui.number] = {}
        self._busy = False

    def build(self) -> None:
        """Put the panel where NiceGUI is; it asks the robot as soon as the page is open."""
        with box("tp-buttons"):
            self._apply = self._button("Apply", self._on_apply, "tp-go")
            self._undo = self._button("Undo", self._on_undo, "tp-plain")
            self._button("Revert to saved", self._on_revert, "tp-plain")
            self._button("Save on board", self._on_save, "tp-plain")
        self._message = ui.html("", tag="p", sanitize=False).classes("tp-message").props("role=status")
        self._list = box("tp-gains")
        self._button("Read from the board", self._load, "tp-plain")
        self._until_loaded = ui.timer(RETRY_S, self._load, immediate=True)

    def _button(self, text: str, action: Callable[[], Any], kind: str) -> ui.element:
        with button(kind).on("click", action) as made:
            ui.html(text, tag="span", sanitize=False)
        return made

    async def _load(self) -> None:
        async def ask() -> str:
            schema = await asyncio.to_thread(self._parameters.schema)
            self._on_board = await asyncio.to_thread(self._parameters.values)
            self._known = {parameter.name: parameter for parameter in schema}
            self._wanted = dict(self._on_board)
            self._rows()
            self._until_loaded.deactivate()
            return ""

        await self._do(ask)

    def _rows(self) -> None:
        self._list.clear()
        self._numbers.clear()
        with self._list:
            for parameter in self._known.values():
                self._row(parameter)
        self._show_changes()

    def _row(self, parameter: Parameter) -> None:
        name, value = parameter.name, round(self._on_board[parameter.name], SHOWN_DIGITS)
        with box("tp-gain"):
            title = f"{DOCS.get(name, '')} {parameter.minimum:g} … {parameter.maximum:g} {parameter.unit}"
            ui.html(escape(name), tag="label", sanitize=False).props(f'title="{title}"')
            ui.html(escape(parameter.unit), tag="small", sanitize=False)
            number = (
                ui.number(
                    value=value,
                    step=_step(parameter),
                    validation=lambda given: parameter.objection(given) or None,
                    on_change=lambda event: self._want(name, event.value),
                )
                .props(f'dense outlined hide-bottom-space aria-label="{name}" data-gain={name}')
                .classes("tp-number")
            )
            slider = ui.slider(
                min=parameter.minimum, max=parameter.maximum, step=_step(parameter), value=value
            ).props(f'aria-label="{name} slider" data-slider={name}')
            slider.on_value_change(partial(self._slide, number))
            number.on_value_change(partial(self._follow, slider, parameter))
            self._numbers[name] = number

    @staticmethod
    def _slide(number: ui.number, event: Any) -> None:
        if number.value != event.value and event.value is not None:
            number.set_value(event.value)

    @staticmethod
    def _follow(slider: ui.slider, parameter: Parameter, event: Any) -> None:
        if not parameter.objection(event.value) and slider.value != event.value:
            slider.set_value(event.value)

    def _want(self, name: str, value: Any) -> None:
        self._wanted[name] = value
        self._show_changes()

    def _changes(self) -> dict[str, Any]:
        return {
            name: value
            for name, value in self._wanted.items()
            if value is None or round(value, SHOWN_DIGITS) != round(self._on_board[name], SHOWN_DIGITS)
        }

    def _show_changes(self) -> None:
        changes = self._changes()
        for name, number in self._numbers.items():
            number.classes(add="tp-changed") if name in changes else number.classes(remove="tp-changed")
        for needing in (self._apply, self._undo):
            needing.props("disabled") if not changes else needing.props(remove="disabled")

    async def _on_apply(self) -> None:
        async def change() -> str:
            answer = await asyncio.to_thread(self._parameters.change, self._known, self._changes())
            self._take(answer)
            return "The board works with " + ", ".join(f"{name} {value:g}" for name, value in answer.items())

        await self._do(change)

    def _on_undo(self) -> None:
        self._take(self._on_board)
        self._say("", good=True)

    async def _on_revert(self) -> None:
        async def revert() -> str:
            self._take(await asyncio.to_thread(self._parameters.revert))
            return "The board works with what it has saved."

        await self._do(revert)

    async def _on_save(self) -> None:
        async def save() -> str:
            if self._changes():
                raise ThumperError("apply or undo your changes first: what the board works with is saved")
            await asyncio.to_thread(self._parameters.save)
            return "Saved: the board keeps them over a reset."

        await self._do(save)

    def _take(self, values: dict[str, float]) -> None:
        self._on_board = {**self._on_board, **values}
        for name, value in values.items():
            self._wanted[name] = value
            self._numbers[name].set_value(round(value, SHOWN_DIGITS))
        self._show_changes()

    async def _do(self, action: Callable[[], Any]) -> None:
        """One question at a time; a refusal is shown where the user looks."""
        if self._busy:
            return
        self._busy = True
        try:
            text, good = await action(), True
        except ThumperError as error:
            text, good = str(error), False
        finally:
            self._busy = False
        self._say(text, good=good)

    def _say(self, text: str, *, good: bool) -> None:
        with self._message:
            self._message.set_content(escape(text))
        self._message.classes(add="good" if good else "bad", remove="bad" if good else "good")


def _step(parameter: Parameter) -> float:
    """A round step near what the wire carries."""
    return 0.001 if parameter.step < 0.005 else 0.01
