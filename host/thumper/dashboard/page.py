"""Layout of the page. `static/` fills the live parts; the forms are NiceGUI's."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

from nicegui import ui

from thumper.dashboard.board_parameters import Parameters
from thumper.dashboard.gains_panel import GainsPanel
from thumper.dashboard.simulator_panel import SimulatorPanel
from thumper.dashboard.widgets import Widget, begin_page, box, button, inline
from thumper.ros.service import QueryClient

DEFAULT_NAME = "thumper"  # of a robot
READOUTS = (
    ("telemetry_age", "Telemetry age", "age of the newest telemetry"),
    ("scan_age", "Scan age", "age of the newest scan"),
    ("loop_late", "Loop late", "how late the previous control cycle started"),
    ("loop_busy", "Loop busy", "how long the previous control cycle took"),
    ("link_frames", "Commands received", "valid frames at the board since its reset; wraps at 65536"),
    ("link_errors", "Frame errors", "frames with a wrong checksum"),
    ("lost_edges", "Lost edges", "encoder edges of unknown direction"),
    ("lidar_scans", "Scans", "scans since the start"),
    ("lidar_errors", "Scan errors", "lidar replies with a wrong checksum"),
    ("lidar_restarts", "Lidar restarts", "how often the lidar was restarted"),
    ("counts", "Encoders left, right", "counts since the board's reset"),
    ("rtt", "Page to server", "round-trip time of this page's heartbeat"),
    ("pages", "Open pages", "pages connected now"),
    ("operator", "Operator", "page that controls the robot; tuning stops if its heartbeats end"),
)

GPS_READOUTS = (
    ("gps_fix", "Fix", "kind of fix and standard deviation"),
    ("gps_age", "Age", "time since the newest message"),
    ("gps_altitude", "Altitude", "above the ellipsoid of WGS 84"),
    ("gps_latitude", "Latitude", "of the antenna, WGS 84"),
    ("gps_longitude", "Longitude", "of the antenna, WGS 84"),
)
IMU_READOUTS = (
    ("imu_rate", "Turn rate", "about the vertical, counter-clockwise positive"),
    ("imu_roll", "Roll", "right side down is positive"),
    ("imu_pitch", "Pitch", "front down is positive"),
    ("imu_age", "Age", "time since the newest sample"),
    ("imu_acceleration", "Acceleration x, y, z", "with gravity, in m/s²"),
)
GYROSCOPE_READOUTS = (
    ("gyro_state", "State", "of the gyroscope on the board"),
    ("gyro_heading", "Heading", "by the gyroscope alone; it wraps"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PageOptions:
    """Name and footprint of the robot, and its library."""

    robot: str
    footprint_m: list[tuple[float, float]]
    address: str = ""  # of the robot's bus
    has_password: bool = False
    library: Path = Path()  # of a robot on this computer


def page_title(robot: str) -> str:
    """Return the title of the browser's tab."""
    return "Thumper" if robot == DEFAULT_NAME else f"{robot} · Thumper"


def build_page(options: PageOptions, robot: QueryClient, board_state: Callable[[], str]) -> None:
    """Build the page for one browser; `board_state` is the newest, as in `thumper_msgs/Wheels`."""
    dark = begin_page("uplot/uPlot.min.css", "style.css")
    _header(options, dark)
    with box("tp-banner-row"):
        banner = box("tp-banner")
        banner.props(f'id=tp-banner data-kind=lost role=status data-address="{options.address}"')
    with box("tp-main"):
        with box("tp-left"):
            with box("tp-mapbox"):
                Widget("map", {"footprint": options.footprint_m}).classes("tp-map")
                injected = _faultbox()
                _lostbox()
            _state_line()
            Widget("charts").classes("tp-wheels")
        with box("tp-right"):
            _tabs(robot, board_state, injected, banner)
    box("tp-notices").props("id=tp-notices role=alert")
    with button("tp-estop", {"data-estop": ""}, "Emergency stop (Space)"):
        inline("<b>STOP</b><small>Space</small>")


def _header(options: PageOptions, dark: ui.dark_mode) -> None:
    with ui.element("header").classes("tp-header"):
        inline('<b class="tp-brand">Thumper</b>')
        if options.robot != DEFAULT_NAME:
            _field("robot", options.robot).classes("tp-robot")
        with ui.element("a").classes("tp-firstrun").props("href=/setup"):
            inline("First run: ")
            _field("first_run")
        with box("tp-chips"):
            _chip("battery_full", "battery", "Battery").classes("tp-battery")
            _chip("satellite_alt", "gps_fix", "Fix and accuracy of the GPS").classes("tp-of-gps")
            _chip("memory", "board_state", "Motor board").classes("tp-board")
            title = "Localization: mapping; or in a saved map searching, localized, or pose lost"
            _chip("my_location", "localization", title).classes("tp-localization")
            _chip("lan", "rtt", "Round-trip time of this page").classes("tp-wide")
        with button("tp-record", {"data-record": ""}, "Start or stop the recording"):
            inline('<i class="tp-dot"></i><span>REC</span>')
            _field("recorded")
        with button("tp-icon tp-help", {"data-shortcuts": ""}, "Keyboard shortcuts (?)"):
            ui.icon("keyboard")
        with button("tp-icon", {}, "Light or dark theme").on("click", partial(_toggle_theme, dark)):
            ui.icon("contrast")
        if options.has_password:
            inline(
                '<form method="post" action="/logout"><button class="tp-icon" title="Log out">'
                '<i class="material-icons">logout</i></button></form>'
            )


async def _toggle_theme(dark: ui.dark_mode) -> None:
    is_dark = dark.value
    if is_dark is None:  # follows the system, which only the browser knows
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
        _command_button("Cancel", {"kind": "command", "name": "cancel"}, "tp-plain tp-cancel")


def _faultbox() -> ui.html:
    """Add the box of a fault; return its line for simulated faults."""
    with box("tp-fault").props("role=alert"):
        with ui.element("details").props("open"):  # closed, it leaves the map free
            with ui.element("summary"):
                inline('<i class="material-icons">error</i>')
                _field("fault_words").classes("tp-fault-words")
            _field("fault_cure").classes("tp-fault-cure")
            injected = ui.html("", tag="span", sanitize=False).classes("tp-fault-injected")
            inline("<p>Clear the fault when it is safe. Then arm the robot, or set a goal.</p>")
        _command_button("Clear fault", {"kind": "command", "name": "clear_fault"}, "tp-plain")
    return injected


def _lostbox() -> None:
    with box("tp-lost").props("role=status"):
        with box(""):
            _field("lost_words").classes("tp-lost-words")
            inline("<p>To set the pose, press on the map where the robot is and drag along its heading.</p>")
        with box("tp-buttons"):
            with button("tp-plain", {"data-select-tool": "pose"}):
                inline("<span>Set pose</span>")
            _command_button("Search the map", {"kind": "command", "name": "relocalize"}, "tp-plain tp-search")


def _tabs(robot: QueryClient, board_state: Callable[[], str], injected: ui.html, banner: ui.element) -> None:
    titles = ("Drive", "Map", "Gains", "Tune", "Sim", "Log", "System")
    with ui.tabs().props("dense no-caps inline-label align=justify").classes("tp-tabs") as tabs:
        for title in titles:
            ui.tab(title.lower(), label=title).classes(f"tp-tab-{title.lower()}")
    with ui.tab_panels(tabs, value="drive", animated=False).props("keep-alive").classes("tp-panels"):
        with ui.tab_panel("drive"):
            _drive_panel()
        with ui.tab_panel("map"):
            Widget("places").classes("tp-places")
            Widget("library").classes("tp-library")
        with ui.tab_panel("gains"):
            gains = GainsPanel(Parameters(robot), board_state)
            tabs.on_value_change(gains.clear_message)
        with ui.tab_panel("tune"):
            Widget("tune").classes("tp-tune")
        with ui.tab_panel("sim"):
            SimulatorPanel(robot, injected, banner)
        with ui.tab_panel("log"):
            Widget("log").classes("tp-log")
        with ui.tab_panel("system"):
            with box("tp-of-gps"):
                _readouts("GPS", GPS_READOUTS)
            with box("tp-of-imu"):
                _readouts("IMU", IMU_READOUTS)
            with box("tp-of-gyroscope"):
                _readouts("Gyroscope on the board", GYROSCOPE_READOUTS)
            _readouts("Links and control loop", READOUTS)


def _drive_panel() -> None:
    with box("tp-buttons tp-commands"):
        _command_button("Arm", {"kind": "command", "name": "arm"}, "tp-go tp-arm")
        _command_button("Disarm", {"kind": "command", "name": "disarm"}, "tp-plain tp-disarm")
        _command_button("Explore", {"kind": "command", "name": "explore"}, "tp-plain")
        _command_button("Save map", {"kind": "command", "name": "save_map"}, "tp-plain")
    with box("tp-other-operator"):
        ui.html("<p>Another page controls the robot.</p>", sanitize=False)
        with button("tp-go", {"data-take-control": ""}):
            inline("<span>Take control</span>")
    inline('<h2 class="tp-drivetitle">Manual driving</h2>')
    Widget("drive").classes("tp-drive")
    with box("tp-camera tp-of-camera"):
        inline("<h2>Camera</h2>")
        Widget("camera").classes("tp-frame")
        _field("camera_age")
    ui.html(
        "<details><summary>How to drive</summary>"
        '<p>Hold the joystick<span class="tp-keyboard"> or W, A, S, D</span> to drive, release to stop; this '
        "has priority over any goal.</p><p>Gamepad: hold LB to drive, RB is turbo, B stops, Start arms.</p>"
        "<p>If this page is hidden, frozen or closed, manual driving and tuning stop; a goal goes on.</p>"
        "</details>",
        sanitize=False,
    ).classes("tp-hint")
    with box("tp-newest"):
        inline("<h2>Newest events</h2>")
        Widget("log").classes("tp-log")


def _readouts(heading: str, readouts: Sequence[tuple[str, str, str]]) -> None:
    inline(f"<h2>{heading}</h2>")
    with box("tp-figures"):
        for name, title, description in readouts:
            with box("tp-figure").props(f'title="{description}"'):
                inline(f"<small>{title}</small>")
                _field(name)


def _chip(icon: str, field: str, title: str) -> ui.element:
    with ui.element("span").classes("tp-chip").props(f'title="{title}"') as chip:
        ui.icon(icon)
        _field(field)
    return chip


def _field(name: str, text: str = "") -> ui.element:
    """Add a field that `static/readouts.js` fills."""
    return ui.html(escape(text), tag="span", sanitize=False).props(f"data-field={name}")


def _command_button(text: str, message: dict[str, Any], classes: str) -> ui.element:
    """Add a button that makes `static/commands.js` send the message."""
    with button(classes, {"data-command": json.dumps(message)}) as element:
        ui.html(text, tag="span", sanitize=False)
    return element
