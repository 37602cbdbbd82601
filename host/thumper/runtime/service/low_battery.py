"""Ends a mission when the battery is low, and drives to the dock or to the place `home`."""

import math
from dataclasses import dataclass, field

from thumper.board.messages import Identity
from thumper.camera.dock_options import DockOptions
from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.ros.to_ros import WARN
from thumper.runtime.drive.drive_manager import DriveManager, DriveMode
from thumper.runtime.drive.task_driver import TaskDriver
from thumper.runtime.drive.waypoints import Waypoints
from thumper.runtime.publisher import Publisher
from thumper.runtime.requests import parse_goal
from thumper.runtime.sensor_inputs import SensorInputs
from thumper.runtime.service.dock_starter import DockStarter
from thumper.runtime.service.map_annotations import MapAnnotations
from thumper.runtime.service.mission_starter import MissionStarter

HOME = "home"  # the place to drive to without a dock
LOW_S = 5.0  # starting motors pull the voltage down for a moment
RECHARGED_V = 0.5  # above the limit: more than an idle battery recovers


def check_low_battery(options: DockOptions, board: Identity) -> None:
    """Raise ThumperError if the board stops the motors before the battery counts as low."""
    stop_V = 1e-3 * board.battery_cells * board.battery_stop_mV
    if 0.0 < options.low_battery_V <= stop_V:
        raise ThumperError(
            f"[dock] low_battery_V is {options.low_battery_V:g} V, but the board stops the motors at "
            f"{stop_V:g} V: choose more, or correct battery_cells and battery_stop on the board",
            exit_code=EXIT_USAGE,
        )


@dataclass(slots=True, kw_only=True)
class LowBattery:
    """Call `update` once per control cycle.

    It acts once: who sends the next goal knows that the battery is low.
    """

    options: DockOptions
    inputs: SensorInputs
    drive_manager: DriveManager
    task_driver: TaskDriver
    publisher: Publisher
    annotations: MapAnnotations
    missions: MissionStarter
    docks: DockStarter
    _low_since_s: float = field(default=math.inf, init=False)
    _has_acted: bool = field(default=False, init=False)
    _goes_home: bool = field(default=False, init=False)  # once the robot has stopped

    def update(self) -> None:
        """End a client's mission if the battery is low; once the robot has stopped, start it home."""
        battery_V, mode = self._battery_V(), self.drive_manager.mode
        if self._goes_home and mode is not DriveMode.STOPPING:
            self._goes_home = False
            if mode is DriveMode.IDLE:  # else somebody drives it already
                self._go_home()
        if battery_V > self.options.low_battery_V + RECHARGED_V:
            self._has_acted = False
        if self._is_low(battery_V) and self._has_mission and not self._has_acted:
            self._has_acted = True
            self._end_mission(f"the battery is low: {battery_V:.1f} V")

    def _end_mission(self, text: str) -> None:
        if self._home() is None:
            cure = f"the map has no place {self.options.place!r} or {HOME!r} to drive to"
            self.publisher.publish_event(f"{text}; {cure}", WARN)
            return
        self.publisher.publish_event(f"{text}; the mission ends", WARN)
        self.drive_manager.stop(text)
        self._goes_home = True

    def _go_home(self) -> None:
        try:
            home = self._home() or HOME
            if home == self.options.place and self.docks.is_possible:
                self.docks.dock()
            else:
                self.missions.start(Waypoints.at(parse_goal({"place": home}, self.annotations.value)))
            self.publisher.publish_event(f"driving to the place {home!r}", WARN)
        except ThumperError as refusal:
            self.publisher.publish_event(f"cannot drive home: {refusal}", WARN)

    def _home(self) -> str | None:
        """Return the place to drive to; None if the map has none."""
        names = {place.name.casefold() for place in self.annotations.value.places}
        return next((name for name in (self.options.place, HOME) if name.casefold() in names), None)

    @property
    def _has_mission(self) -> bool:
        task = self.task_driver.task
        return task is not None and not task.is_over and not self.docks.is_busy

    def _battery_V(self) -> float:
        telemetry = self.inputs.telemetry
        return math.inf if telemetry is None else telemetry.battery_mV / 1000.0

    def _is_low(self, battery_V: float) -> bool:
        now_s = self.inputs.now_s()
        is_low = battery_V < self.options.low_battery_V
        self._low_since_s = min(self._low_since_s, now_s) if is_low else math.inf
        return now_s - self._low_since_s >= LOW_S
