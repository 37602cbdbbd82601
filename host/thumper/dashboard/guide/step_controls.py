"""The text and the buttons of each step. What moves the robot is sent by the page, which then guards it."""

import json
from collections.abc import Callable
from html import escape
from pathlib import Path
from typing import Any, get_args

from nicegui import ui

from thumper.dashboard.guide.guide import Guide, Step
from thumper.dashboard.guide.robot_file import (
    LABORATORY,
    ROBOT_FILE,
    WORLDS,
    Ports,
    free_name,
    simulated_ports,
)
from thumper.dashboard.widgets import box, button, inline
from thumper.doctor.usb_ports import usb_ports
from thumper.lidar.options import LidarModel

TITLES = {
    Step.ROBOT: "Find the robot",
    Step.FLASH: "Flash the firmware",
    Step.CHECK: "Check wheels and lidar",
    Step.START: "Put it on the floor",
    Step.TUNE: "Tune the wheels",
    Step.DRIVE: "Drive it",
    Step.MAP: "Map the room",
    Step.GOAL: "Drive to a goal",
    Step.SAVE: "Save the map",
    Step.DONE: "Done",
}
LANE_M = 1.2
BOARDS = {"trex": "T'REX", "nano": "Nano or Uno"}
BOOTLOADERS = {"old": "old (T'REX, most Nanos)", "new": "new (Uno, Nanos since 2018)"}


class StepControls:
    """Adds the controls of the guide's step; keeps what the user has entered on this page."""

    def __init__(self, guide: Guide) -> None:
        self.confirming = False
        self._guide = guide
        self._file = free_name(Path())
        self._map_name = "first_map"
        self._board = self._lidar = ""
        self._world = LABORATORY
        self._model, self._kind, self._bootloader = "urg04lx", "trex", "old"

    def add(self) -> None:
        """Add the controls of the current step to the current container."""
        getattr(self, f"_{self._guide.step}")()

    def _robot(self) -> None:
        if (known := self._guide.ports) is not None:
            _text(f"{self._guide.config}: board {known.board}, lidar {known.lidar}.")
            with box("tp-buttons"):
                self._button("Use this robot", lambda: self._guide.choose_robot("", known))
            return
        if is_there := ROBOT_FILE.exists():
            _text(f"{ROBOT_FILE} exists already. Use it as it is, or set up a robot in a new file below.")
            with box("tp-buttons"):
                self._button(f"Use {ROBOT_FILE}", lambda: self._guide.use_file(ROBOT_FILE))
        ports = usb_ports()
        devices = {port.device: f"{port.device}: {port.name}" for port in ports}
        self._lidar = next((port.device for port in ports if port.is_lidar), "")
        self._board = next((port.device for port in ports if port.device != self._lidar), "")
        if ports:
            _text(
                "Which port is the board, and which the lidar? If in doubt, unplug one and press Search "
                "again: its port is gone."
            )
            self._select("Board", "_board", devices)
            self._select("Lidar", "_lidar", devices)
            self._select("Lidar model", "_model", {name: name for name in get_args(LidarModel)})
        else:
            _text("No USB serial port found. Plug in the board and the lidar, or use a simulated robot.")
        self._field("New configuration file", "_file")
        with box("tp-buttons"):
            if ports:
                self._button("Use this robot", self._choose, main=not is_there)
            self._button("Search again", self._search, main=False)
        self._select("World of a simulated robot", "_world", {label: label for label in WORLDS})
        with box("tp-buttons"):
            self._button("Use a simulated robot", self._choose_simulated, main=not (ports or is_there))

    async def _choose(self) -> None:
        ports = Ports(board=self._board, lidar=self._lidar, lidar_model=self._model)
        await self._guide.choose_robot(self._file, ports)

    async def _choose_simulated(self) -> None:
        await self._guide.choose_robot(self._file, simulated_ports(self._world))

    def _search(self) -> None:
        self._guide.begin(Step.ROBOT)
        self.confirming = not self.confirming  # shows the step again

    @property
    def _is_simulated(self) -> bool:
        """Whether nobody stands beside the robot: then nothing asks for wheels or floor."""
        return self._guide.ports is not None and self._guide.ports.simulated

    def _flash(self) -> None:
        _text("Flash writes Thumper's program to the board, and then asks the board for its version.")
        if self._guide.ports is not None and not self._is_simulated:
            _text(
                "Block the chassis up first: no wheel may touch anything. Switch on the battery. If a wheel "
                "turns, switch it off: the motors are wired wrongly, or an old program drives them."
            )
            self._select("Board", "_kind", BOARDS)
            self._select("Boot loader", "_bootloader", BOOTLOADERS)
        with box("tp-buttons"):
            self._button("Flash", lambda: self._guide.flash(self._kind, self._bootloader))
            self._button("Skip: it has the firmware", self._guide.advance, main=False)

    def _check(self) -> None:
        if not self._is_simulated:
            _text("Keep the chassis on the block, wheels in the air, and a hand on the battery's switch.")
        watched = "the charts" if self._is_simulated else "the wheels and the charts"
        _text(f"Each side turns alone for a second. Watch {watched}: each side must turn forward.")
        if self.confirming:
            self._confirm("Are all wheels off the ground?", "Yes, turn the wheels", self._guide.check)
            return
        if self._guide.is_moving:
            self._cancel(self._guide.interrupt)
            return
        with box("tp-buttons"):
            check = self._guide.check if self._is_simulated else self._ask
            self._button("Turn the wheels", check, main=not self._has_passed)
            outcome = self._guide.outcomes.get(Step.CHECK)
            if outcome is not None and outcome.verdict != "fail":
                self._button("Continue", self._guide.advance, main=self._has_passed)

    def _start(self) -> None:
        if self._is_simulated:
            _text("The simulator puts the robot on the floor of its world.")
        else:
            _text(f"Put the robot on the floor, with {LANE_M:g} m of free space ahead of it and behind it.")
        _text("The first start takes up to two minutes, because it compiles.")
        with box("tp-buttons"):
            self._button("Start the robot", self._guide.start)

    def _tune(self) -> None:
        _text(
            "The robot drives back and forth on its own, measures both motors and sets matching gains. That "
            "takes about 90 s. STOP or leaving this page ends it."
        ).props(f"data-lane={LANE_M:g}")  # the map draws it
        if self._guide.is_tuned:
            with box("tp-buttons"):
                self._button("Keep the gains", self._guide.keep_gains)
                self._button("Do not keep them", self._guide.drop_gains, main=False)
            return
        if self._guide.is_moving:
            self._cancel()
            return
        message = {"kind": "experiment", "name": "tune", "lane_m": LANE_M}
        if self.confirming:
            question = f"Is a lane of {LANE_M:g} m ahead and behind clear, 0.8 m wide?"
            self._confirm(question, "Yes, tune the wheels", None, message)
            return
        with box("tp-buttons"):
            if self._is_simulated:
                self._button("Tune", self._guide.repeat, main=not self._has_passed, message=message)
            else:
                self._button("Tune", self._ask, main=not self._has_passed)
            self._next()

    def _drive(self) -> None:
        _text(
            "Press Arm, then drag the joystick up and hold it: the robot drives ahead. Release it: the robot "
            "stops. The step is done after 0.3 m."
        )
        with box("tp-buttons"):
            self._arm(main=not self._has_passed)
            self._next()

    def _map(self) -> None:
        _text(
            "Press Explore: the robot drives to the edges of its map, at 0.2 m/s, until the room is "
            "complete, and returns."
        )
        beside = "" if self._is_simulated else "Stay beside it. "
        _text(f"{beside}Or press Arm and drive it with the joystick.")
        if self._guide.is_moving:
            self._cancel()
            return
        with box("tp-buttons"):
            explore = {"kind": "command", "name": "explore"}
            self._button("Explore", self._guide.repeat, main=not self._has_passed, message=explore)
            self._arm(main=False)
            self._next()

    def _goal(self) -> None:
        _text(
            "Press on the map at a free place, and drag in the direction that the robot should face. "
            "Release: the robot drives there. For another goal, choose the flag again."
        )
        with box("tp-buttons"):
            self._next()

    def _save(self) -> None:
        self._field("Name of the map", "_map_name")
        with box("tp-buttons"):
            self._button("Save the map", lambda: self._guide.save(self._map_name))

    def _done(self) -> None:
        command = f"thumper run --config {self._guide.config} --ui"
        if self._guide.saved_map:
            command += f" --map {self._guide.saved_map}"
        _text("The robot is set up, and its map is saved.")
        _text("Press Ctrl-C in the terminal to stop it. Start it the next time with:")
        inline(f"<pre>{escape(command)}</pre>")
        _text("It drives at 0.2 m/s at most until you delete that limit from the file.")

    def _arm(self, *, main: bool) -> None:
        """Add the button for the joystick: it arms, or disarms."""
        if self._guide.is_armed:
            self._button("Disarm", None, main=False, message={"kind": "command", "name": "disarm"})
        else:
            self._button("Arm", None, main=main, message={"kind": "command", "name": "arm"})

    def _next(self) -> None:
        """Add the button that goes on: the main one once the step has succeeded."""
        succeeded = self._has_passed
        self._button("Continue" if succeeded else "Skip", self._guide.advance, main=succeeded)

    @property
    def _has_passed(self) -> bool:
        outcome = self._guide.outcomes.get(self._guide.step)
        return outcome is not None and outcome.verdict == "pass"

    def _cancel(self, action: Callable[[], Any] | None = None) -> None:
        """Add the button that ends the motion of this step: by `action`, or by a command to the robot."""
        data = {} if action else {"data-command": '{"kind": "command", "name": "cancel"}'}
        with box("tp-buttons"), button("tp-plain", data) as element:
            inline("<span>Cancel</span>")
        if action is not None:
            element.on("click", action)

    def _ask(self) -> None:
        self.confirming = True

    def _confirm(
        self,
        question: str,
        answer: str,
        action: Callable[[], Any] | None,
        message: dict[str, Any] | None = None,
    ) -> None:
        async def confirmed() -> None:
            self.confirming = False
            if action is not None:
                await action()

        def refused() -> None:
            self.confirming = False

        ui.label(question).classes("tg-question")
        with box("tp-buttons"):
            self._button(answer, confirmed, message=message)
            self._button("Not yet", refused, main=False)

    def _button(
        self,
        text: str,
        action: Callable[[], Any] | None,
        *,
        main: bool = True,
        message: dict[str, Any] | None = None,
    ) -> None:
        """Add a button that calls `action` on the server, and makes the page send `message`."""
        data = {} if message is None else {"data-command": json.dumps(message)}
        with button("tp-go" if main else "tp-plain", data) as element:
            inline(f"<span>{escape(text)}</span>")
        if self._guide.busy is not None:
            element.props("disabled")
        if action is not None:
            element.on("click", action)

    def _select(self, label: str, attribute: str, options: dict[str, str]) -> None:
        value = getattr(self, attribute)
        (
            ui.select(
                options,
                label=label,
                value=value if value in options else None,
                on_change=lambda event: setattr(self, attribute, event.value or ""),
            )
            .props("dense outlined")
            .classes("tg-field")
        )

    def _field(self, label: str, attribute: str) -> None:
        (
            ui.input(
                label,
                value=getattr(self, attribute),
                on_change=lambda event: setattr(self, attribute, str(event.value or "")),
            )
            .props("dense outlined")
            .classes("tg-field")
        )


def _text(text: str) -> ui.label:
    return ui.label(text).classes("tg-text")
