"""Layout of the guide's page: the steps on one side, the map on the other."""

import asyncio
import base64
import json
from pathlib import Path

from nicegui import app as nicegui_app
from nicegui import ui

from thumper.dashboard.guide.guide import STEPS, Guide, Step
from thumper.dashboard.guide.robot_watch import WatchedBus
from thumper.dashboard.guide.step_controls import TITLES, StepControls
from thumper.dashboard.page import PageOptions
from thumper.dashboard.page_commands import PageCommands
from thumper.dashboard.server_limits import drop_abandoned_pages
from thumper.dashboard.widgets import STATIC, Widget, begin_page, box, button, inline

PERIOD_S = 0.25
SHOWN_LINES = 12
WIRING = "wiring.svg"
IN_WHEEL = Path(__file__).parents[2] / "packaging" / WIRING
IN_SOURCES = Path(__file__).resolve().parents[4] / "docs" / "images" / WIRING
SHOW_STEP = "document.querySelector('.tg-now')?.scrollIntoView({block: 'center'})"
# The map's tools may not be there yet when the page opens at this step, and need the map.
SELECT_GOAL_TOOL = """(function select() {
  const tool = document.querySelector('[data-tool=goal]');
  if (tool && !tool.disabled) tool.click();
  else setTimeout(select, 100);
})()"""
ADD_ROWS = "document.querySelector('.tp-wheels').charts?.append(%s)"
MARKS = {"pass": "check_circle", "warn": "warning", "fail": "error", "skip": "remove_circle_outline"}


def add_guide(guide: Guide, robot: WatchedBus, options: PageOptions, commands: PageCommands) -> None:
    """Add the page `/setup` to the web application, and run the guide with it."""
    guide.connect(robot)
    commands.on_stop = guide.interrupt
    tasks: list[asyncio.Task[None]] = []

    @ui.page("/setup", title="First run · Thumper", favicon=STATIC / "icon.svg")
    def setup() -> None:
        _build_page(guide, options)
        drop_abandoned_pages()

    async def start() -> None:
        tasks.append(asyncio.create_task(guide.run()))

    async def stop() -> None:
        for task in tasks:
            task.cancel()
        await guide.close()

    nicegui_app.on_startup(start)
    nicegui_app.on_shutdown(stop)


def _build_page(guide: Guide, options: PageOptions) -> None:
    """Build the page for one browser."""
    begin_page("uplot/uPlot.min.css", "style.css", "guide.css")
    with ui.element("header").classes("tp-header"):
        inline(
            '<b class="tp-brand">Thumper</b><span>First run</span><span class="tp-chips">'
            '<span class="tp-chip tp-battery" title="Battery"><span data-field="battery"></span></span>'
            '<span class="tp-chip tp-board" title="Motor board"><span data-field="board_state"></span></span>'
            '<a class="tp-chip" href="/" target="_blank">Dashboard</a></span>'
        )
    with box("tp-banner-row"):
        box("tp-banner").props("id=tp-banner data-kind=lost role=status")
    with box("tg-main") as main:
        with box("tg-left"):
            steps = box("tg-steps")
            with box("tg-manual"):
                Widget("drive").classes("tp-drive")
        with box("tg-right"):
            with box("tg-wiring"):  # until there is a map
                ui.label("How the parts are connected").classes("tg-title")
                ui.label("Simulated, as if wired like this.").classes("tg-simulated")
                inline(f'<img src="{_wiring()}" alt="Battery, board, motors, encoders, computer and lidar">')
            with box("tp-mapbox"):
                Widget("map", {"footprint": options.footprint_m}).classes("tp-map")
            with box("tp-state"):
                inline(
                    '<span class="tp-mode" data-field="mode"></span>'
                    '<span class="tp-reason" data-field="reason"></span>'
                )
            Widget("charts", {"open": True}).classes("tp-wheels")
    with box("tg-fault").props("role=alert"):
        inline('<b data-field="fault_words"></b><span data-field="fault_cure"></span>')
        inline("<span>Clear the fault when it is safe. Then press the button of the step again.</span>")
        with button("tp-plain", {"data-command": '{"kind": "command", "name": "clear_fault"}'}):
            inline("<span>Clear fault</span>")
    box("tp-notices").props("id=tp-notices role=alert")
    with button("tp-estop", {"data-estop": ""}, "Emergency stop (Space)"):
        inline("<b>STOP</b><small>Space</small>")
    view = GuideView(guide, main, steps)
    ui.timer(PERIOD_S, view.refresh, immediate=True)


def _wiring() -> str:
    """Return the wiring drawing as the address of an image: inline, its style would apply to the page."""
    drawing = IN_WHEEL if IN_WHEEL.exists() else IN_SOURCES
    return f"data:image/svg+xml;base64,{base64.b64encode(drawing.read_bytes()).decode()}"


class GuideView:
    """The steps as one browser shows them."""

    def __init__(self, guide: Guide, main: ui.element, steps: ui.element) -> None:
        self._guide = guide
        self._main = main
        self._steps = steps
        self._controls = StepControls(guide)
        self._shown: tuple[object, ...] = ()  # what the built steps show
        self._outcome: ui.label | None = None
        self._output: ui.label | None = None
        self._sent = 0  # of the wheel check's rows

    def refresh(self) -> None:
        """Rebuild the steps if they have changed; else update only the texts."""
        guide = self._guide
        outcome = guide.outcomes.get(guide.step)
        verdict = outcome.verdict if outcome else ""
        moves = (guide.is_moving, guide.is_armed, bool(guide.rows))
        now = (guide.step, guide.busy, verdict, guide.is_tuned, moves, self._controls.confirming)
        if now != self._shown:
            is_new_step = self._shown[:1] != now[:1]
            if is_new_step:
                self._controls.confirming = False
            self._shown = (*now[:-1], self._controls.confirming)
            self._build()
            if is_new_step:
                ui.run_javascript(SHOW_STEP)
                if guide.step is Step.GOAL:
                    ui.run_javascript(SELECT_GOAL_TOOL)
        if guide.rows[self._sent :]:
            ui.run_javascript(ADD_ROWS % json.dumps(guide.rows[self._sent :]))
        self._sent = len(guide.rows)
        if self._outcome is not None:
            self._outcome.set_text(outcome.text if outcome else "")
        if self._output is not None:
            self._output.set_text("\n".join(guide.lines[-SHOWN_LINES:]))

    def _build(self) -> None:
        guide = self._guide
        self._main.props(f"data-step={guide.step}")
        has_charts = guide.step in (Step.CHECK, Step.TUNE)
        self._main.props("data-charts") if has_charts else self._main.props(remove="data-charts")
        is_simulated = guide.ports is not None and guide.ports.simulated
        self._main.props("data-simulated") if is_simulated else self._main.props(remove="data-simulated")
        self._steps.clear()
        self._outcome = self._output = None
        with self._steps:
            for number, step in enumerate(STEPS[:-1], start=1):
                with box("tg-step").props(f"data-name={step}") as card:
                    self._head(number, step)
                    if step is guide.step:
                        card.classes("tg-now").props('aria-current="step"')
                        self._body()
            if guide.step is Step.DONE:
                with box("tg-step tg-now").props("data-name=done"):
                    self._controls.add()

    def _head(self, number: int, step: Step) -> None:
        guide, outcome = self._guide, self._guide.outcomes.get(step)
        with button("tg-head").on("click", lambda: guide.begin(step)) as head:
            if outcome is None and step is not guide.step and STEPS.index(step) > STEPS.index(guide.step):
                head.props("disabled")
            if outcome is None or step is guide.step:
                inline(f'<span class="tg-number">{number}</span>')
            else:
                ui.icon(MARKS[outcome.verdict]).classes(f"tg-{outcome.verdict}")
            ui.label(TITLES[step]).classes("tg-title")
            if outcome is not None and step is not guide.step:
                ui.label(outcome.text).classes("tg-result")

    def _body(self) -> None:
        guide = self._guide
        outcome = guide.outcomes.get(guide.step)
        with box("tg-body"):
            self._controls.add()
            tone = f"tg-outcome tg-{outcome.verdict}" if outcome else "tg-outcome"
            self._outcome = ui.label().classes(tone).props("role=status")
            self._output = ui.label().classes("tg-output")
