"""Everything the robot makes, once a beat, as ROS 2 messages, to whoever wants it: bus, recorder, page."""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from thumper.board.fault_texts import FAULT_HINTS
from thumper.board.messages import Fault
from thumper.common.geometry import FloatArray, Pose2
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.navigator import NavigationOutput
from thumper.ros.codec import Message
from thumper.ros.status import Status
from thumper.ros.to_ros import ERROR, INFO, WARN, Messages
from thumper.ros.topics import TOPICS
from thumper.runtime.drive.drive_manager import DriveManager
from thumper.runtime.sensor_inputs import SensorInputs
from thumper.runtime.state_estimator import RobotState
from thumper.slam.mapper import HasParticles

Sink = Callable[[str, float, Message], None]
"""Takes a topic's name, the robot's time [s] and the message. It must neither wait nor raise."""

MAP_PERIOD_S = 1.0
COSTMAP_PERIOD_S = 0.5
COSTMAP_RADIUS_M = 2.5
PARTICLES_PERIOD_S, MAX_PARTICLES = 0.5, 200


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTiming:
    """How the loop kept up in the beat before this one, which is not over yet."""

    late_s: float = 0.0  # how much later than due it began
    busy_s: float = 0.0  # how long its work took


class Publisher:
    """Hands each product to every sink; without sinks it makes none."""

    def __init__(
        self, *, robot: str, base_from_laser: Pose2, messages: Messages, simulated: bool = False
    ) -> None:
        self.messages = messages
        self.recording = False
        self._robot = robot
        self._base_from_laser = base_from_laser
        self._simulated = simulated
        self._sinks: list[Sink] = []
        self._latched: dict[str, tuple[float, Message]] = {}
        self._map_s = self._costmap_s = self._particles_s = -np.inf
        self._scans_in_map = 0
        self._plan_m: FloatArray = np.empty((0, 2))
        self._transition: object = None
        self._fault = Fault.NONE
        self._noted: set[str] = set()  # kinds of notes
        self._time_s = 0.0

    def add_sink(self, sink: Sink) -> None:
        """Let somebody have everything from now on, and at once the newest of what is latched."""
        self._sinks.append(sink)
        for topic, (stamp_s, message) in self._latched.items():
            self._hand(sink, topic, stamp_s, message)

    def remove_sink(self, sink: Sink) -> None:
        """Leave somebody alone."""
        if sink in self._sinks:
            self._sinks.remove(sink)

    def publish(
        self,
        inputs: SensorInputs,
        drive_manager: DriveManager,
        output: NavigationOutput | None,
        timing: LoopTiming,
    ) -> None:
        """Hand out what a beat has brought; called once the wheels have their order."""
        state = inputs.estimator.state()
        if not self._sinks or state is None:
            return
        self._time_s = time_s = state.time_s
        if "tf_static" not in self._latched:
            self._send("tf_static", self.messages.fixed_transforms(time_s, self._base_from_laser))
        for sample in inputs.samples:
            self._put("wheels", sample.time_s, self.messages.wheels(sample))
        for scan in inputs.scans:
            self._put("scan", scan.time_s, self.messages.scan(scan))
        if inputs.samples:
            self._send("battery", self.messages.battery(inputs.samples[-1]))
        self._publish_pose(inputs, state)
        self._send("cmd_vel", self.messages.twist(time_s, drive_manager.command))
        if output is not None:
            self._publish_plans(drive_manager, output, state)
        self._publish_map(inputs)
        self._publish_events(inputs, drive_manager)
        self._send("status", self.messages.status(self._status(inputs, drive_manager, state, timing)))

    def publish_event(self, text: str, level: int = INFO, *, name: str = "robot") -> None:
        """Tell people one line."""
        self._send("events", self.messages.event(self._time_s, level, text, name))

    def publish_text(self, topic: str, message: Message) -> None:
        """Hand out a message that somebody else has made."""
        self._send(topic, message)

    def _publish_pose(self, inputs: SensorInputs, state: RobotState) -> None:
        time_s, estimator = state.time_s, inputs.estimator
        odometry = estimator.odometry
        assert odometry is not None  # there is a state
        self._send("odom", self.messages.odometry(odometry))
        self._send("pose", self.messages.pose(time_s, state.map_from_base))
        map_from_odom = estimator.mapper.map_from_odom
        self._send("tf", self.messages.transforms(time_s, map_from_odom, odometry.odom_from_base))
        mapper = estimator.mapper
        poses = mapper.particle_poses if isinstance(mapper, HasParticles) else None
        if poses is not None and len(poses) and time_s >= self._particles_s + PARTICLES_PERIOD_S:
            self._particles_s = time_s
            some = poses[:: -(-len(poses) // MAX_PARTICLES)]
            self._send("particles", self.messages.particles(time_s, some))

    def _publish_plans(
        self, drive_manager: DriveManager, output: NavigationOutput, state: RobotState
    ) -> None:
        time_s = state.time_s
        if not np.array_equal(output.plan, self._plan_m):
            self._plan_m = output.plan
            self._send("plan", self.messages.path(time_s, output.plan))
        self._send("local_plan", self.messages.path(time_s, output.local_plan))
        costmap = drive_manager.navigator.costmap
        if costmap is not None and time_s >= self._costmap_s + COSTMAP_PERIOD_S:
            self._costmap_s = time_s
            near = _cropped(costmap, state.map_from_base)
            self._send("local_costmap", self.messages.costmap(time_s, near))

    def _publish_map(self, inputs: SensorInputs) -> None:
        scans = inputs.estimator.scans_mapped
        if scans != self._scans_in_map and self._time_s >= self._map_s + MAP_PERIOD_S:
            self._map_s, self._scans_in_map = self._time_s, scans
            self._send("map", self.messages.grid(self._time_s, inputs.estimator.mapper.grid()))

    def _publish_events(self, inputs: SensorInputs, drive_manager: DriveManager) -> None:
        transitions = drive_manager.navigator.transitions
        if transitions and transitions[-1] is not self._transition:
            self._transition = newest = transitions[-1]
            why = f": {newest.reason}" if newest.reason else ""
            self.publish_event(f"{newest.before or 'start'} -> {newest.after}{why}", name="navigation")
        for kind, line in inputs.estimator.notes().items():
            if kind not in self._noted:  # the first of its kind; how many there were is told at the end
                self._noted.add(kind)
                self.publish_event(line, WARN, name="localisation")
        fault = Fault.NONE if inputs.telemetry is None else inputs.telemetry.fault
        if fault is not self._fault:
            self._fault = fault
            told = f"fault {int(fault)}, {_words(fault)}: {FAULT_HINTS[fault]}" if fault else "fault cleared"
            self.publish_event(told, ERROR if fault else INFO, name="board")

    def _status(
        self, inputs: SensorInputs, drive_manager: DriveManager, state: RobotState, timing: LoopTiming
    ) -> Status:
        telemetry, goal, lidar = inputs.telemetry, drive_manager.goal, inputs.lidar.counters
        assert telemetry is not None  # there is a state
        return Status(
            time_s=state.time_s,
            robot=self._robot,
            mode=drive_manager.mode.value,
            reason=drive_manager.reason,
            simulated=self._simulated,
            recording=self.recording,
            has_goal=goal is not None,
            goal_x_m=goal.x_m if goal else 0.0,
            goal_y_m=goal.y_m if goal else 0.0,
            goal_yaw_rad=math.nan if goal is None or goal.theta_rad is None else goal.theta_rad,
            distance_to_goal_m=goal.distance_m(state.map_from_base) if goal else 0.0,
            board_state=telemetry.state.name,
            fault=int(telemetry.fault),
            fault_words=_words(telemetry.fault),
            fault_cure=FAULT_HINTS.get(telemetry.fault, ""),
            loop_late_s=timing.late_s,
            loop_busy_s=timing.busy_s,
            telemetry_age_s=inputs.board.now_s() - state.time_s,
            scan_age_s=state.scan_age_s,
            link_frames=telemetry.rx_frames,
            link_errors=inputs.board.receive_errors + telemetry.rx_errors,
            lost_edges=telemetry.lost_edges,
            lidar_scans=lidar.scans,
            lidar_errors=lidar.bad_replies + lidar.port_errors,
            lidar_restarts=lidar.restarts,
        )

    def _send(self, topic: str, message: Message) -> None:
        self._put(topic, self._time_s, message)

    def _put(self, topic: str, stamp_s: float, message: Message) -> None:
        if TOPICS[topic].latched:
            self._latched[topic] = (stamp_s, message)
        for sink in tuple(self._sinks):
            self._hand(sink, topic, stamp_s, message)

    def _hand(self, sink: Sink, topic: str, stamp_s: float, message: Message) -> None:
        with suppress(Exception):  # the robot drives on, whatever a listener does
            sink(topic, stamp_s, message)


def _words(fault: Fault) -> str:
    return "" if fault is Fault.NONE else fault.name.lower().replace("_", " ")


def _cropped(costmap: Costmap, map_from_base: Pose2) -> Costmap:
    """The part round the robot."""
    size_m = costmap.resolution_m
    rows, columns = costmap.costs.shape
    row = int((map_from_base.y_m - costmap.origin_y_m) / size_m)
    column = int((map_from_base.x_m - costmap.origin_x_m) / size_m)
    reach = round(COSTMAP_RADIUS_M / size_m)
    top, left = min(max(row - reach, 0), rows), min(max(column - reach, 0), columns)
    part = np.s_[top : max(row + reach, top), left : max(column + reach, left)]
    return replace(
        costmap,
        costs=costmap.costs[part],
        squared_cells=costmap.squared_cells[part],
        origin_x_m=costmap.origin_x_m + left * size_m,
        origin_y_m=costmap.origin_y_m + top * size_m,
    )
