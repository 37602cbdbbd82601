"""Panel of a simulated robot: simulation speed, world, obstacles, faults."""

import asyncio
from collections.abc import Mapping
from functools import partial
from html import escape
from typing import Any

from nicegui import ui

from thumper.common.errors import ThumperError
from thumper.dashboard.widgets import box, button, inline
from thumper.ros import services
from thumper.ros.service import QueryClient

SPEEDS = (0.25, 0.5, 1.0, 2.0, 5.0)
POLL_PERIOD_S = 2.0  # the robot may start after the page, and other pages may apply faults
POSE_EXAMPLE = "1.0, 0.5, 90"


class SimulatorPanel:
    """The panel of one page."""

    def __init__(self, robot: QueryClient, injected: ui.html, banner: ui.element) -> None:
        """Add the panel to the current NiceGUI container; it queries the simulator once the page is open.

        `injected` shows the active faults beside a fault of the board, which they may explain; `banner` names
        the world.
        """
        self._banner = banner
        self._robot = robot
        self._injected = injected
        self._faults: Mapping[str, Mapping[str, Any]] = {}
        self._speeds: dict[float, ui.element] = {}
        inline("<h2>Speed</h2>")
        with box("tp-buttons"):
            for speed in SPEEDS:
                with button("tp-plain").on("click", partial(self._send, {"speed": speed})) as choice:
                    ui.html(f"{speed:g}x", tag="span", sanitize=False)
                self._speeds[speed] = choice
        inline("<h2>World</h2>")
        with box("tp-buttons"):
            with button("tp-plain", {"data-select-tool": "obstacle"}):
                ui.html("Add a pillar", tag="span", sanitize=False)
            with button("tp-plain").on("click", partial(self._send, {"clear_pillars": True})):
                ui.html("Remove all pillars", tag="span", sanitize=False)
        with box("tp-faultrow") as self._restart:
            self._world = ui.select([], label="World").props("dense outlined").classes("tp-select")
            with button("tp-plain").on("click", self._on_world):
                ui.html("Start in this world", tag="span", sanitize=False)
        self._restart.set_visibility(False)
        inline("<h2>Faults</h2>")
        with box("tp-faultrow"):
            self._name = (
                ui.select([], label="Fault", on_change=self._on_fault_selected)
                .props("dense outlined options-dense")
                .classes("tp-select")
            )
            self._choice = ui.select([], label="Kind").props("dense outlined").classes("tp-select")
            self._amount = ui.number(label="Amount").props("dense outlined").classes("tp-select")
            self._place = ui.input(label="x [m], y [m], heading [°]", placeholder=POSE_EXAMPLE)
            self._place.props("dense outlined stack-label")
            with button("tp-go").on("click", self._on_apply):
                ui.html("Apply fault", tag="span", sanitize=False)
        self._effect = ui.html("", tag="p", sanitize=False).classes("tp-hint")
        self._active = ui.html("", tag="p", sanitize=False).classes("tp-active-faults")
        with button("tp-plain").on("click", partial(self._send, {"clear_faults": True})) as self._clear:
            ui.html("Remove all faults", tag="span", sanitize=False)
        self._message = ui.html("", tag="p", sanitize=False).classes("tp-message").props("role=status")
        self._on_fault_selected()
        ui.timer(POLL_PERIOD_S, self._poll, immediate=True)

    async def _poll(self) -> None:
        try:
            world = await asyncio.to_thread(services.SIMULATOR_WORLD.call, self._robot)
        except ThumperError:
            return  # no robot yet, or a real one: the tab is hidden
        if not self._faults:
            self._faults = world.faults
            names = {name: self._fault_title(name) for name in self._faults}
            self._name.set_options(names, value=next(iter(names), None))
        active = escape(", ".join(f"{self._fault_title(name)} {value}" for name, value in world.on.items()))
        self._active.set_content(f"Active faults: {active or 'none'}")
        self._injected.set_content(f"Simulated faults: {active} (tab Sim)" if active else "")
        self._name_world(world.titles.get(world.world, world.world).partition(":")[0])
        self._clear.set_visibility(bool(world.on))
        for speed, choice in self._speeds.items():
            choice.props(f"aria-pressed={str(speed == world.speed).lower()}")
        if world.worlds != list(self._world.options):
            names = {name: world.titles.get(name, name) for name in world.worlds}
            self._world.set_options(names, value=world.world if world.world in world.worlds else None)
            self._restart.set_visibility(bool(world.worlds))

    def _name_world(self, title: str) -> None:
        """Let `static/readouts.js` show the world in the banner."""
        if self._banner.props.get("data-world") != title:
            self._banner.props["data-world"] = title

    def _fault_title(self, name: str) -> str:
        """Return a fault's title, and its name at the test bench: "Left encoder: wire A (encoder.left.a)"."""
        title = self._faults.get(name, {}).get("title")
        return f"{title} ({name})" if title else name

    def _on_fault_selected(self) -> None:
        fault = self._faults.get(str(self._name.value), {})
        self._effect.set_content(escape(f"{fault.get('effect', '')} {_end_of(fault)}".strip()))
        self._place.error = None
        self._choice.set_visibility("choices" in fault)
        self._amount.set_visibility("most" in fault)
        self._place.set_visibility("pose" in fault)
        if "choices" in fault:
            choices = fault["choices"]  # most begin with ok, which applies no fault
            self._choice.set_options(choices, value=next(kind for kind in choices if kind != "ok"))
        if "most" in fault:
            self._amount.props(f'label="0 … {fault["most"]:g} {fault["unit"]}"')

    async def _on_apply(self) -> None:
        name = self._name.value
        fault = self._faults.get(str(name), {})
        value: Any = self._choice.value if "choices" in fault else self._amount.value
        if "pose" in fault:
            try:
                x_m, y_m, heading_deg = (float(part) for part in str(self._place.value).split(","))
            except ValueError:
                self._place.error = f"enter three numbers, for example {POSE_EXAMPLE}"
                return
            value, self._place.error = [x_m, y_m, heading_deg], None
        await self._send({"fault": name, "value": value})

    async def _on_world(self) -> None:
        await self._send({"world": self._world.value})

    async def _send(self, content: dict[str, Any]) -> None:
        try:
            reply = await asyncio.to_thread(services.SIMULATOR_COMMAND.call, self._robot, content)
        except ThumperError as error:
            self._show_message(str(error), good=False)
        else:
            self._show_message(reply.text, good=True)
        await self._poll()

    def _show_message(self, text: str, *, good: bool) -> None:
        self._message.set_content(escape(text))
        self._message.classes(add="good" if good else "bad", remove="bad" if good else "good")


def _end_of(fault: Mapping[str, Any]) -> str:
    """Return how a fault ends; empty if it is a single event, or ends by itself."""
    normal = "ok" if "ok" in fault.get("choices", ()) else fault.get("normal")
    if normal is None:
        return ""
    return f"It stays active until you set it to {normal if normal == 'ok' else format(normal, 'g')}."
