"""The page: where everything is. What is live in it is done by `static/`; forms are NiceGUI's."""

import json
from dataclasses import dataclass
from functools import partial
from html import escape
from typing import Any

from nicegui import ui

from thumper.dashboard.board_parameters import Asker, Parameters
from thumper.dashboard.gains_panel import GainsPanel
from thumper.dashboard.simulator_panel import SimulatorPanel
from thumper.dashboard.widgets import STATIC, Part, box, button, inline

FIGURES = (
    ("telemetry_age", "Board heard", "age of the newest telemetry"),
    ("scan_age", "Lidar heard", "age of the newest scan"),
    ("loop_late", "Loop late", "how much later than due the beat before began"),
    ("loop_busy", "Loop busy", "how long the work of the beat before took"),
    ("link_frames", "Frames", "good frames that the board has heard since its reset; wraps at 65536"),
    ("link_errors", "Frame errors", "frames that did not check"),
    ("lost_edges", "Lost edges", "encoder edges of unknown direction"),
    ("lidar_scans", "Scans", "scans since the start"),
    ("lidar_errors", "Scan errors", "replies of the lidar that did not check"),
    ("lidar_restarts", "Lidar restarts", "how often the lidar was started anew"),
    ("counts", "Encoders", "counts, left and right"),
    ("rtt", "Page to server", "round trip of this page's heartbeat"),
    ("pages", "Open pages", "pages that are connected now"),
    ("operator", "At the helm", "the page whose orders drive, and whose silence stops the robot"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PageOptions:
    """What the page is told of the robot."""

    robot: str
    footprint_m: list[tuple[float, float]]


def build_page(options: PageOptions, robot: Asker) -> None:
    """Build the page for one browser."""
    ui.colors(primary="#2f81f7", negative="#d1242f", positive="#1a7f37", dark="#18222d", dark_page="#0f1720")
    for sheet in ("uplot/uPlot.min.css", "style.css"):
        ui.add_css(STATIC / sheet)
    dark = ui.dark_mode(value=None)
    ui.query(".nicegui-content").classes("tp-content")
    _header(options.robot, dark)
    with box("tp-banner-row"):
        box("tp-banner").props("id=tp-banner data-kind=lost role=status")
    with box("tp-main"):
        with box("tp-left"):
            Part("map", {"footprint": options.footprint_m}).classes("tp-map")
            _state_line()
            Part("charts").classes("tp-wheels")
        with box("tp-right"):
            _faultbox()
            _tabs(robot)
    box("tp-notices").props("id=tp-notices role=alert")
    with button("tp-estop", {"data-estop": ""}, "Emergency stop: Space or Esc anywhere"):
        inline("<b>STOP</b><small>Space · Esc</small>")


def _header(robot: str, dark: ui.dark_mode) -> None:
    with ui.element("header").classes("tp-header"):
        inline('<b class="tp-brand">Thumper</b>')
        _field("robot", robot).classes("tp-robot")
        with box("tp-chips"):
            _chip("battery_full", "battery", "Battery").classes("tp-battery")
            _chip("memory", "board_state", "Motor board")
            _chip("lan", "rtt", "Round trip of this page").classes("tp-wide")
        with button("tp-record", {"data-record": ""}, "Start or stop the recording"):
            inline('<i class="tp-dot"></i><span>REC</span>')
            _field("recorded")
        with button("tp-icon", {}, "Light or dark").on("click", partial(_turn, dark)):
            ui.icon("contrast")


async def _turn(dark: ui.dark_mode) -> None:
    is_dark = dark.value
    if is_dark is None:  # as the system has it: only the browser knows
        is_dark = await ui.run_javascript("Quasar.Dark.isActive")
    dark.set_value(not is_dark)


def _state_line() -> None:
    with box("tp-state"):
        _field("mode").classes("tp-mode")
        _field("reason").classes("tp-reason")
        for name, title in (("distance", "to goal"), ("pose", "at"), ("heading", "heading")):
            with ui.element("span").classes(f"tp-pair tp-{name}"):
                inline(f"<small>{title}</small>")
                _field(name)


def _faultbox() -> None:
    with box("tp-fault").props("role=alert"):
        inline('<i class="material-icons">error</i>')
        with box(""):
            _field("fault_words").classes("tp-fault-words")
            _field("fault_cure").classes("tp-fault-cure")
            _order("Clear fault", {"kind": "command", "name": "clear_fault"}, "tp-plain")


def _tabs(robot: Asker) -> None:
    names = {"drive": "Drive", "gains": "Gains", "tune": "Tune", "sim": "Sim", "log": "Log"}
    with ui.tabs().props("dense no-caps inline-label align=justify").classes("tp-tabs") as tabs:
        for name, title in names.items():
            ui.tab(name, label=title).classes(f"tp-tab-{name}")
    with ui.tab_panels(tabs, value="drive", animated=False).props("keep-alive").classes("tp-panels"):
        with ui.tab_panel("drive"):
            _drive_panel()
        with ui.tab_panel("gains"):
            GainsPanel(Parameters(robot)).build()
        with ui.tab_panel("tune"):
            Part("tune").classes("tp-tune")
        with ui.tab_panel("sim"):
            SimulatorPanel(robot).build()
        with ui.tab_panel("log"):
            Part("log").classes("tp-log")


def _drive_panel() -> None:
    with box("tp-buttons"):
        _order("Arm", {"kind": "command", "name": "arm"}, "tp-go tp-arm")
        _order("Disarm", {"kind": "command", "name": "disarm"}, "tp-plain")
        _order("Cancel goal", {"kind": "command", "name": "cancel"}, "tp-plain")
        _order("Save map", {"kind": "command", "name": "save_map"}, "tp-plain")
    inline("<h2>By hand</h2>")
    Part("drive").classes("tp-drive")
    ui.html(
        "<p>Hold the stick to drive, let go to stop; it goes before any goal. Gamepad: hold LB, RB is turbo, "
        "B stops, Start arms. What this page has set going stops when it is hidden, frozen or closed.</p>",
        sanitize=False,
    ).classes("tp-hint")
    inline("<h2>Links and loop</h2>")
    _figures()


def _figures() -> None:
    with box("tp-figures"):
        for name, title, meaning in FIGURES:
            with box("tp-figure").props(f'title="{meaning}"'):
                inline(f"<small>{title}</small>")
                _field(name)


def _chip(icon: str, field: str, title: str) -> ui.element:
    with ui.element("span").classes("tp-chip").props(f'title="{title}"') as chip:
        ui.icon(icon)
        _field(field)
    return chip


def _field(name: str, text: str = "") -> ui.element:
    """A place that `static/readouts.js` fills."""
    return ui.html(escape(text), tag="span", sanitize=False).props(f"data-field={name}")


def _order(text: str, order: dict[str, Any], kind: str) -> ui.element:
    """A button that `static/commands.js` acts on."""
    with button(kind, {"data-command": json.dumps(order)}) as ordering:
        ui.html(text, tag="span", sanitize=False)
    return ordering
