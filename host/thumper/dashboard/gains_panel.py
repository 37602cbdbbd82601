"""Panel with the board's parameters: edit them, then apply, undo, revert or save all changes."""

import asyncio
from collections.abc import Callable
from functools import partial
from html import escape
from typing import Any

from nicegui import ui

from thumper.board.fault_texts import ARMED_STATES
from thumper.common.errors import ThumperError
from thumper.dashboard.board_parameters import DOCS, Parameter, Parameters
from thumper.dashboard.gains_help import EFFECTS, gains_help, gains_warning
from thumper.dashboard.widgets import box, button

DECIMALS = 3
RETRY_S = 2.0  # the robot may start after the page
BOARD_PERIOD_S = 0.5  # between looks at the board's state
REVERSED = ("left_motor_reversed", "right_motor_reversed", "left_encoder_reversed", "right_encoder_reversed")
GROUPS = {  # of what describes the robot; all others are gains
    "Wheels and motors": ("counts_per_rev", "wheel_radius", "track", *REVERSED, "pwm_frequency"),
    "Battery and currents": (
        "battery_cells",
        "battery_stop",
        "battery_rearm",
        "current_limit",
        "stall_current",
        "current_scale",
        "current_zero",
        "currents_at_a4",
    ),
    "Inputs and sensors": ("input_1", "input_2", "gyroscope", "tilt_limit", "impact_limit"),
}
YES_NO = {0: "0: no", 1: "1: yes"}
INPUT = {0: "0: unused", 1: "1: stops while low", 2: "2: stops while high"}
CHOICES = {
    **dict.fromkeys((*REVERSED, "currents_at_a4"), YES_NO),
    "input_1": INPUT,
    "input_2": INPUT,
    "gyroscope": {0: "0: none", 1: "1: z axis up", 2: "2: z axis down"},
}


class GainsPanel:
    """The panel of one page."""

    def __init__(self, parameters: Parameters, board_state: Callable[[], str]) -> None:
        """Add the panel to the current NiceGUI container; it queries the robot once the page is open."""
        self._parameters = parameters
        self._board_state, self._state = board_state, ""
        self._schema: dict[str, Parameter] = {}
        self._on_board: dict[str, float] = {}
        self._edited: dict[str, Any] = {}
        self._fields: dict[str, ui.number | ui.select] = {}
        self._drawing: ui.html | None = None
        self._margins: ui.html | None = None
        self._warning: ui.html | None = None
        self._busy = False
        with box("tp-buttons"):
            self._apply = self._button("Apply", self._on_apply, "tp-go")
            self._undo = self._button("Undo", self._on_undo, "tp-plain")
            self._revert = self._button("Revert", self._on_revert, "tp-plain")
            self._button("Save", self._on_save, "tp-plain")
        self._message = (
            ui.html("", tag="p", sanitize=False).classes("tp-message tp-apply").props("role=status")
        )
        self._list = box("tp-gains")
        self._button("Read from board", self._load, "tp-plain")
        self._retry_timer = ui.timer(RETRY_S, self._load, immediate=True)
        ui.timer(BOARD_PERIOD_S, self._follow_board, immediate=True)

    def clear_message(self) -> None:
        """Remove the result of the last action, which may be true no longer."""
        self._show_message("", "good")

    def _follow_board(self) -> None:
        """Disable Revert, which an armed board refuses, and remove a reason that held in another state."""
        if (state := self._board_state()) == self._state:
            return
        self._state = state
        self.clear_message()
        if state in ARMED_STATES:
            self._revert.props('disabled title="disarm first"')
        else:
            self._revert.props(remove="disabled title")

    def _button(self, text: str, action: Callable[[], Any], classes: str) -> ui.element:
        with button(classes).on("click", action) as element:
            ui.html(text, tag="span", sanitize=False)
        return element

    async def _load(self) -> None:
        async def load() -> str:
            schema = await asyncio.to_thread(self._parameters.schema)
            self._on_board = await asyncio.to_thread(self._parameters.values)
            self._schema = {parameter.name: parameter for parameter in schema}
            self._edited = dict(self._on_board)
            self._rows()
            self._retry_timer.deactivate()
            return ""

        await self._run(load)

    def _rows(self) -> None:
        self._list.clear()
        self._fields.clear()
        grouped = {name for names in GROUPS.values() for name in names}
        with self._list:
            for parameter in self._schema.values():
                if parameter.name not in grouped:
                    self._row(parameter)
                if parameter.name == "ki":
                    self._add_help()
            for title, names in GROUPS.items():
                with ui.expansion(title).classes("tp-gaingroup"):
                    for name in names:
                        if name in self._schema:
                            self._row(self._schema[name])
        self._show_changes()

    def _add_help(self) -> None:
        with box("tp-gainshelp"):
            self._warning = ui.html("", tag="p", sanitize=False).props("role=status")
            self._margins = ui.html("", sanitize=False).classes("tp-margins")
            self._drawing = ui.html("", sanitize=False).classes("tp-loop")

    def _row(self, parameter: Parameter) -> None:
        name, value = parameter.name, round(self._on_board[parameter.name], DECIMALS)
        choices = CHOICES.get(name, {})
        with box("tp-gain"):
            ui.html(escape(name), tag="label", sanitize=False)
            unit = parameter.unit.replace("^2", "²")
            limits = "" if choices else f"{parameter.minimum:g} … {parameter.maximum:g} {unit}"
            ui.html(escape(limits), tag="small", sanitize=False)
            field: ui.number | ui.select
            if choices:
                field = ui.select(choices, value=value)
            else:
                field = number = ui.number(
                    value=value,
                    step=_step(parameter),
                    validation=lambda entered: parameter.range_error(entered) or None,
                )
                self._add_slider(parameter, number)
            field.on_value_change(lambda event: self._edit(name, event.value))
            field.props(f'dense outlined hide-bottom-space aria-label="{name}" data-gain={name}')
            field.classes("tp-number")
            text = EFFECTS.get(name, DOCS.get(name, ""))
            ui.html(escape(text), tag="p", sanitize=False).classes("tp-gaintext")
            self._fields[name] = field

    def _add_slider(self, parameter: Parameter, number: ui.number) -> None:
        slider = ui.slider(
            min=parameter.minimum, max=parameter.maximum, step=_step(parameter), value=number.value
        ).props(f'aria-label="{parameter.name} slider" data-slider={parameter.name}')
        slider.on_value_change(partial(self._set_number, number))
        number.on_value_change(partial(self._move_slider, slider, parameter))

    @staticmethod
    def _set_number(number: ui.number, event: Any) -> None:
        if number.value != event.value and event.value is not None:
            number.set_value(event.value)

    @staticmethod
    def _move_slider(slider: ui.slider, parameter: Parameter, event: Any) -> None:
        if not parameter.range_error(event.value) and slider.value != event.value:
            slider.set_value(event.value)

    def _edit(self, name: str, value: Any) -> None:
        self._edited[name] = value
        if name in self._changes():  # not the answer of the board
            self.clear_message()
        self._show_changes()

    def _changes(self) -> dict[str, Any]:
        return {
            name: value
            for name, value in self._edited.items()
            if value is None or round(value, DECIMALS) != round(self._on_board[name], DECIMALS)
        }

    def _show_changes(self) -> None:
        changes = self._changes()
        errors = {name: self._schema[name].range_error(value) for name, value in changes.items()}
        mistakes = [f"{name} {error}." for name, error in errors.items() if error]
        if self._drawing is not None and self._margins is not None and self._warning is not None:
            drawing, margins, text = "", "", " ".join(mistakes)
            if not mistakes:
                drawing, margins, text = gains_help(self._edited, self._on_board)
            self._drawing.set_content(drawing)
            self._margins.set_content(margins)
            self._warning.set_content(escape(text))
            is_risky = bool(gains_warning(self._edited)) and not mistakes
            self._warning.classes(add="warn" if is_risky else "", remove="" if is_risky else "warn")
        for name, field in self._fields.items():
            field.classes(add="tp-changed") if name in changes else field.classes(remove="tp-changed")
        for element, is_usable in ((self._apply, changes and not mistakes), (self._undo, changes)):
            element.props(remove="disabled") if is_usable else element.props("disabled")

    async def _on_apply(self) -> None:
        async def change() -> str:
            answer = await asyncio.to_thread(self._parameters.set, self._schema, self._changes())
            self._show_values(answer)
            uses = (f"{name} {round(value, DECIMALS):g}" for name, value in answer.items())
            return f"The board now uses {', '.join(uses)}. {gains_warning(self._on_board)}".strip()

        await self._run(change, lambda: "warn" if gains_warning(self._on_board) else "good")

    def _on_undo(self) -> None:
        self._show_values(self._on_board)
        self.clear_message()

    async def _on_revert(self) -> None:
        async def revert() -> str:
            self._show_values(await asyncio.to_thread(self._parameters.revert))
            return "The board uses its saved parameters again."

        await self._run(revert)

    async def _on_save(self) -> None:
        async def save() -> str:
            if self._changes():
                raise ThumperError("apply or undo your changes first; Save stores the values in use")
            await asyncio.to_thread(self._parameters.save)
            return "Saved. The board keeps these values after a reset."

        await self._run(save)

    def _show_values(self, values: dict[str, float]) -> None:
        self._on_board = {**self._on_board, **values}
        for name, value in values.items():
            self._edited[name] = value
            self._fields[name].set_value(round(value, DECIMALS))
        self._show_changes()

    async def _run(
        self, action: Callable[[], Any], tone_of_result: Callable[[], str] = lambda: "good"
    ) -> None:
        """Run one action at a time and show its result, or the reason why it failed."""
        if self._busy:
            return
        self._busy = True
        try:
            text, tone = await action(), tone_of_result()
        except ThumperError as error:
            text, tone = str(error), "bad"
        finally:
            self._busy = False
        self._show_message(text, tone)

    def _show_message(self, text: str, tone: str) -> None:
        with self._message:
            self._message.set_content(escape(text))
        self._message.classes(add=tone, remove=" ".join({"good", "warn", "bad"} - {tone}))


def _step(parameter: Parameter) -> float:
    """Return a round step near the resolution on the wire."""
    if parameter.step == 1.0:
        return 1.0
    return 0.001 if parameter.step < 0.005 else 0.01
