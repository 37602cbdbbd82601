"""What can be done to a simulated robot: the speed of its clock, its world, its faults."""

import asyncio
from collections.abc import Mapping
from functools import partial
from html import escape
from typing import Any

from nicegui import ui

from thumper.common.errors import ThumperError
from thumper.dashboard.board_parameters import Asker
from thumper.dashboard.widgets import box, button, inline

SPEEDS = (0.25, 0.5, 1.0, 2.0, 5.0)
LOOK_PERIOD_S = 2.0  # the robot may come later than the page, and other pages order faults too
CARRY_HINT = "x, y, heading°"


class SimulatorPanel:
    """One page's panel."""

    def __init__(self, robot: Asker) -> None:
        self._robot = robot
        self._faults: Mapping[str, Mapping[str, Any]] = {}

    def build(self) -> None:
        """Put the panel where NiceGUI is; it asks the simulator as soon as the page is open."""
        inline("<h2>Speed</h2>")
        with box("tp-buttons"):
            for speed in SPEEDS:
                with button("tp-plain").on("click", partial(self._order, {"speed": speed})):
                    ui.html(f"{speed:g}x", tag="span", sanitize=False)
        inline("<h2>World</h2>")
        with box("tp-buttons"):
            with button("tp-plain", {"data-choose": "obstacle"}):
                ui.html("Put up a pillar", tag="span", sanitize=False)
            with button("tp-plain").on("click", partial(self._order, {"clear_pillars": True})):
                ui.html("Take pillars down", tag="span", sanitize=False)
        inline("<h2>Faults</h2>")
        with box("tp-faultrow"):
            self._name = (
                ui.select([], label="What", on_change=self._on_name)
                .props("dense outlined options-dense")
                .classes("tp-select")
            )
            self._choice = ui.select([], label="How").props("dense outlined").classes("tp-select")
            self._amount = ui.number(label="How much").props("dense outlined").classes("tp-select")
            self._place = ui.input(label="Where", placeholder=CARRY_HINT).props("dense outlined")
            with button("tp-go").on("click", self._on_fault):
                ui.html("Do it", tag="span", sanitize=False)
        self._on = ui.html("", tag="p", sanitize=False).classes("tp-faults-on")
        self._message = ui.html("", tag="p", sanitize=False).classes("tp-message").props("role=status")
        inline(
            '<p class="tp-hint">Everything goes on until it is set to ok again. What each fault does is in '
            "the test bench's page of the manual.</p>"
        )
        self._on_name()
        ui.timer(LOOK_PERIOD_S, self._look, immediate=True)

    async def _look(self) -> None:
        try:
            world = await asyncio.to_thread(self._robot.query, "simulator/world", {})
        except ThumperError:
            return  # no robot yet, or a real one: the tab is not shown
        self._on.set_content(escape(_in_words(world["on"])))
        if not self._faults:
            self._faults = world["faults"]
            self._name.set_options(list(self._faults), value=next(iter(self._faults), None))

    def _on_name(self) -> None:
        kind = self._faults.get(str(self._name.value), {})
        self._choice.set_visibility("choices" in kind)
        self._amount.set_visibility("most" in kind)
        self._place.set_visibility("pose" in kind)
        if "choices" in kind:
            self._choice.set_options(kind["choices"], value=kind["choices"][0])
        if "most" in kind:
            self._amount.props(f'label="0 … {kind["most"]:g} {kind["unit"]}"')

    async def _on_fault(self) -> None:
        name = self._name.value
        kind = self._faults.get(str(name), {})
        value: Any = self._choice.value if "choices" in kind else self._amount.value
        if "pose" in kind:
            try:
                value = [float(part) for part in str(self._place.value).split(",")]
            except ValueError:
                self._say(f"give {CARRY_HINT}, as in 1.0, 0.5, 90", good=False)
                return
        await self._order({"fault": name, "value": value})

    async def _order(self, content: dict[str, Any]) -> None:
        try:
            answer = await asyncio.to_thread(self._robot.query, "simulator/command", content)
        except ThumperError as error:
            self._say(str(error), good=False)
        else:
            self._say(str(answer.get("text", "")), good=True)
        await self._look()

    def _say(self, text: str, *, good: bool) -> None:
        self._message.set_content(escape(text))
        self._message.classes(add="good" if good else "bad", remove="bad" if good else "good")


def _in_words(faults: Mapping[str, Any]) -> str:
    """What is wrong now, as it was ordered on any page or over the bus."""
    return f"Wrong now: {', '.join(f'{name} {value}' for name, value in faults.items()) or 'nothing'}"
