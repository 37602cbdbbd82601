"""Publishes the state of the robot as ROS 2 messages, once per control cycle, to bus and recorder."""

import math
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from thumper.board.fault_texts import FAULT_HINTS, FAULT_NAMES, fault_line
from thumper.board.messages import Fault
from thumper.camera.options import CameraOptions
from thumper.common.geometry import FloatArray, Pose2
from thumper.gps.earth_reference import EarthReference
from thumper.gps.fix import Fix
from thumper.maps.annotations import Annotations
from thumper.maps.cell_changes import RenderHistory
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.navigator import NavigationOutput
from thumper.navigation.state import NavigationState, Transition
from thumper.ros.codec import Message
from thumper.ros.markers import markers, object_markers
from thumper.ros.status import Status
from thumper.ros.to_ros import ERROR, INFO, WARN, Messages, map_change
from thumper.ros.topics import TOPICS
from thumper.runtime.drive.data_age import LIDAR_LOST, SCAN_TIMEOUT_S
from thumper.runtime.drive.drive_manager import DriveManager
from thumper.runtime.sensor_inputs import BLIND_S, SensorInputs
from thumper.runtime.sensor_table import SILENT_S
from thumper.runtime.state_estimator import RobotState
from thumper.slam.localization.amcl import Amcl
from thumper.slam.mapper import HasParticles, Mapper
from thumper.slam.mode_switch import SlamModeSwitch

Sink = Callable[[str, float, Message], None]
"""Receives topic, time on the robot's clock [s] and message. Must neither block nor raise."""

MAP_PERIOD_S = 1.0
COSTMAP_PERIOD_S = 0.5
COSTMAP_RADIUS_M = 2.5
FINAL = (NavigationState.REACHED.value, NavigationState.FAILED.value)
PARTICLES_PERIOD_S, MAX_PARTICLES = 0.5, 200
POSE_LOST_S = 1.0  # an event says so then


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTiming:
    """Timing of the previous control cycle [s]."""

    late_s: float = 0.0  # from its telemetry to its start
    busy_s: float = 0.0  # computing time


class RunningRecorder(Protocol):
    """What the status says about a recorder."""

    is_paused: bool

    @property
    def active(self) -> bool: ...


class Publisher:
    """Passes every message to every sink; without sinks it makes none but events and texts."""

    def __init__(
        self,
        *,
        robot: str,
        base_from_laser: Pose2,
        base_from_gps: Pose2 | None,
        camera: CameraOptions | None,
        messages: Messages,
        now_s: Callable[[], float],
        simulated: bool = False,
    ) -> None:
        """`base_from_gps` and `camera` are None without one.

        `now_s`, the robot's clock [s], stamps events and texts.
        """
        self.messages = messages
        self.recorder: RunningRecorder | None = None
        self.mission_reports_end = False  # the navigator's line would repeat it
        self.experiment = ""  # what drives the board past the drive manager
        self.objects = ""  # what a detector has seen, in one line; empty without one
        self._robot = robot
        self._base_from_laser, self._base_from_gps = base_from_laser, base_from_gps
        self._camera = camera
        self._now_s = now_s
        self._simulated = simulated
        self._sinks: list[Sink] = []
        self._latched: dict[str, Message] = {}
        self._map_s = self._costmap_s = self._particles_s = -np.inf
        self._scans_in_map = 0
        self._map_history: RenderHistory | None = None  # of the map published last
        self._plan_m: FloatArray = np.empty((0, 2))
        self._transition: Transition | None = None
        self._fault = Fault.NONE
        self._warned: set[str] = set()  # kinds of warnings
        self._has_scans = True
        self._silent: set[str] = set()  # names of sensors
        self._was_waiting = False
        self._pose_known_s, self._is_pose_lost = -math.inf, False
        self._localizer: Amcl | None = None
        self._refused_pose: Pose2 | None = None  # of the localizer, as said last
        self._searches = False  # the localizer is new, and has not found the pose
        self._localization = "mapping"  # as in `Status`

    def add_sink(self, sink: Sink) -> None:
        """Send all messages to `sink` from now on, and at once the newest message of each latched topic."""
        self._sinks.append(sink)
        now_s = self._now_s()  # the time of delivery: the message may be hours old
        for topic, message in self._latched.items():
            self._deliver(sink, topic, now_s, message)

    def remove_sink(self, sink: Sink) -> None:
        """Send nothing more to `sink`."""
        if sink in self._sinks:
            self._sinks.remove(sink)

    def publish(
        self,
        inputs: SensorInputs,
        drive_manager: DriveManager,
        output: NavigationOutput | None,
        timing: LoopTiming,
    ) -> None:
        """Publish the results of a control cycle, after the wheels have their command."""
        state = inputs.estimator.state()
        if not self._sinks or state is None:
            return
        time_s = state.time_s
        if "tf_static" not in self._latched:
            fixed = self.messages.fixed_transforms(
                time_s, self._base_from_laser, self._base_from_gps, self._camera
            )
            self._send("tf_static", time_s, fixed)
            if self._camera is not None:
                self._send("camera_info", time_s, self.messages.camera_info(time_s, self._camera))
        for feed in inputs.feeds:  # before the wheels, as the state estimator gets them
            for sample in feed.to_publish():
                self._send(feed.kind.name, sample.time_s, feed.kind.message(self.messages, sample))
                if isinstance(sample, Fix):
                    self._publish_in_map(sample, inputs.estimator.earth)
        for sample in inputs.samples:
            self._send("wheels", sample.time_s, self.messages.wheels(sample))
        for imu in inputs.board_imu:
            self._send("imu", imu.time_s, self.messages.imu(imu))
        for scan in inputs.scans:
            self._send("scan", scan.time_s, self.messages.scan(scan))
        if inputs.samples:
            self._send("battery", time_s, self.messages.battery(inputs.samples[-1]))
        self._publish_pose(inputs, state)
        self._send("cmd_vel", time_s, self.messages.twist(time_s, drive_manager.command))
        if output is not None:
            self._publish_plans(drive_manager, output, state)
        self._publish_map(inputs, time_s)
        self._publish_events(inputs, drive_manager)
        self._publish_localization(inputs.estimator.mapper, state)
        self._publish_losses(inputs, state, drive_manager)
        status = self._status(inputs, drive_manager, state, timing)
        self._send("status", time_s, self.messages.status(status))

    def publish_event(self, text: str, level: int = INFO, *, name: str = "robot") -> None:
        """Publish one line for people, stamped now."""
        now_s = self._now_s()
        self._send("events", now_s, self.messages.event(now_s, level, text, name))

    def publish_text(self, topic: str, message: Message) -> None:
        """Publish a message without a stamp of its own; sinks receive it as of now."""
        self._send(topic, self._now_s(), message)

    def publish_markers(self, annotations: Annotations) -> None:
        """Publish zones and places for viewers."""
        now_s = self._now_s()
        self._send("markers", now_s, markers(self.messages, now_s, annotations))

    def publish_objects(self, objects: Iterable[tuple[str, float, float]]) -> None:
        """Publish label, x and y [m] of each object that a detector has seen."""
        now_s = self._now_s()
        self._send("objects", now_s, object_markers(self.messages, now_s, objects))

    def _publish_in_map(self, fix: Fix, earth: EarthReference | None) -> None:
        at_m = None if earth is None else earth.in_map(fix)
        if at_m is not None:
            self._send("gps_odom", fix.time_s, self.messages.fix_in_map(fix, *at_m))

    def _publish_pose(self, inputs: SensorInputs, state: RobotState) -> None:
        time_s, estimator = state.time_s, inputs.estimator
        odometry, mapper = estimator.odometry, estimator.mapper
        assert odometry is not None  # there is a state
        self._send("odom", time_s, self.messages.odometry(odometry))
        covariance = mapper.quality().covariance  # of the newest scan
        self._send("pose", time_s, self.messages.pose(time_s, state.map_from_base, covariance))
        transforms = self.messages.transforms(time_s, estimator.map_from_odom, odometry.odom_from_base)
        self._send("tf", time_s, transforms)
        poses = mapper.particle_poses if isinstance(mapper, HasParticles) else None
        if poses is not None and len(poses) and time_s >= self._particles_s + PARTICLES_PERIOD_S:
            self._particles_s = time_s
            step = -(-len(poses) // MAX_PARTICLES)
            self._send("particles", time_s, self.messages.particles(time_s, poses[::step]))

    def _publish_plans(
        self, drive_manager: DriveManager, output: NavigationOutput, state: RobotState
    ) -> None:
        time_s = state.time_s
        if not np.array_equal(output.plan, self._plan_m):
            self._plan_m = output.plan
            self._send("plan", time_s, self.messages.path(time_s, output.plan))
        self._send("local_plan", time_s, self.messages.path(time_s, output.local_plan))
        costmap = drive_manager.navigator.costmap
        if costmap is not None and time_s >= self._costmap_s + COSTMAP_PERIOD_S:
            self._costmap_s = time_s
            cropped = _cropped(costmap, state.map_from_base)
            self._send("local_costmap", time_s, self.messages.costmap(time_s, cropped))

    def _publish_map(self, inputs: SensorInputs, time_s: float) -> None:
        scans = inputs.estimator.scans_mapped
        if scans != self._scans_in_map and time_s >= self._map_s + MAP_PERIOD_S:
            grid = inputs.estimator.mapper.grid()
            changed = grid.changed_since(self._map_history)
            before, new = self._latched.get("map"), self.messages.grid(time_s, grid)
            self._send("map", time_s, new)
            self._send("map_changes", time_s, map_change(before, new, changed))  # who lacks `before` fetches
            self._map_s, self._scans_in_map, self._map_history = time_s, scans, grid.history

    def _publish_events(self, inputs: SensorInputs, drive_manager: DriveManager) -> None:
        transitions = drive_manager.navigator.transitions
        if transitions and transitions[-1] is not self._transition:
            self._transition = newest = transitions[-1]
            reason = f": {newest.reason}" if newest.reason else ""
            if not (self.mission_reports_end and newest.after in FINAL):
                self.publish_event(f"{newest.after}{reason}", name="navigation")
        for kind, line in inputs.estimator.warnings().items():
            if kind not in self._warned:  # the first of its kind; the command prints the counts at the end
                self._warned.add(kind)
                self.publish_event(line, WARN, name="localization")
        fault = Fault.NONE if inputs.telemetry is None else inputs.telemetry.fault
        if fault is not self._fault:
            self._fault = fault
            text = fault_line(fault) if fault else "fault cleared"
            self.publish_event(text, ERROR if fault else INFO, name="board")

    def _publish_localization(self, mapper: Mapper, state: RobotState) -> None:
        """Say when the pose is lost for longer than a few scans, and when it is found, also in a new map."""
        localizer = mapper.localizer if isinstance(mapper, SlamModeSwitch) else None
        if localizer is not self._localizer:
            self._localizer, self._searches, self._refused_pose = localizer, localizer is not None, None
        if localizer and localizer.refused_pose is not self._refused_pose:
            self._refused_pose = localizer.refused_pose
            pose = state.map_from_base
            line = (
                f"the scans contradict the pose that was set; they fit at ({pose.x_m:z.2f}, {pose.y_m:z.2f})"
            )
            self.publish_event(line, WARN, name="localization")
        if not state.lost:
            self._pose_known_s = state.time_s
        is_lost = state.time_s > self._pose_known_s + POSE_LOST_S
        if is_lost and not self._is_pose_lost:
            self.publish_event(f"pose lost: {state.lost}", WARN, name="localization")
        elif not state.lost and (self._is_pose_lost or self._searches):
            self.publish_event("pose found", name="localization")
            self._searches = False
        self._is_pose_lost = is_lost
        if self._searches:
            self._localization = "searching"
        elif is_lost:
            self._localization = "pose lost" if localizer else "pose lost while mapping"
        else:
            self._localization = "mapping" if localizer is None else "localized"

    def _publish_losses(self, inputs: SensorInputs, state: RobotState, drive_manager: DriveManager) -> None:
        """Say when a sensor falls silent and when it sends again, and why a drive waits."""
        for feed in inputs.feeds:
            name, is_silent = feed.kind.name, feed.is_silent(state.time_s)
            if is_silent and name not in self._silent:
                self._silent.add(name)
                self.publish_event(
                    f"no data from the {name} for {SILENT_S:.0f} s; check its cable", WARN, name=name
                )
            elif not is_silent and name in self._silent:
                self._silent.remove(name)
                self.publish_event(f"the {name} sends data again", name=name)
        limit_s = BLIND_S if not self._has_scans else SCAN_TIMEOUT_S
        has_scans = state.scan_age_s < limit_s or math.isinf(state.scan_age_s)  # inf: none yet
        if has_scans != self._has_scans:
            self._has_scans = bool(has_scans)
            text = "the lidar sends scans again" if has_scans else LIDAR_LOST
            self.publish_event(text, INFO if has_scans else WARN, name="lidar")
        if drive_manager.is_waiting and not self._was_waiting:
            self.publish_event(drive_manager.reason, WARN, name="navigation")
        self._was_waiting = drive_manager.is_waiting

    @property
    def is_recording(self) -> bool:
        """Whether a recorder takes the messages."""
        return self.recorder is not None and self.recorder.active

    def _status(
        self, inputs: SensorInputs, drive_manager: DriveManager, state: RobotState, timing: LoopTiming
    ) -> Status:
        telemetry, goal, lidar = inputs.telemetry, drive_manager.goal, inputs.lidar.counters
        recorder = self.recorder if self.is_recording else None
        assert telemetry is not None  # there is a state
        return Status(
            time_s=state.time_s,
            robot=self._robot,
            mode="experiment" if self.experiment else drive_manager.mode.value,
            reason=self.experiment or drive_manager.activity,
            simulated=self._simulated,
            recording=recorder is not None,
            recording_paused=recorder is not None and recorder.is_paused,
            has_goal=goal is not None,
            goal_x_m=goal.x_m if goal else 0.0,
            goal_y_m=goal.y_m if goal else 0.0,
            goal_yaw_rad=math.nan if goal is None or goal.theta_rad is None else goal.theta_rad,
            distance_to_goal_m=goal.distance_m(state.map_from_base) if goal else 0.0,
            board_state=telemetry.state.name,
            fault=int(telemetry.fault),
            fault_words=FAULT_NAMES.get(telemetry.fault, ""),
            fault_cure=FAULT_HINTS.get(telemetry.fault, ""),
            loop_late_s=timing.late_s,
            loop_busy_s=timing.busy_s,
            telemetry_age_s=inputs.board.now_s() - state.time_s,
            scan_age_s=state.scan_age_s,
            link_frames=telemetry.rx_frames,
            link_errors=inputs.board.receive_errors + telemetry.rx_errors,
            lost_edges=telemetry.lost_edges,
            lidar_scans=lidar.samples,
            lidar_errors=lidar.bad_replies + lidar.port_errors,
            lidar_restarts=lidar.restarts,
            sensors="\n".join(
                filter(None, (*(feed.summary(state.time_s) for feed in inputs.feeds), self.objects))
            ),
            pose_lost=state.lost,
            localization=self._localization,
        )

    def _send(self, topic: str, time_s: float, message: Message) -> None:
        if TOPICS[topic].latched:
            self._latched[topic] = message
        for sink in tuple(self._sinks):
            self._deliver(sink, topic, time_s, message)

    def _deliver(self, sink: Sink, topic: str, time_s: float, message: Message) -> None:
        with suppress(Exception):  # no sink may stop the robot
            sink(topic, time_s, message)


def _cropped(costmap: Costmap, map_from_base: Pose2) -> Costmap:
    """Return the part around the robot."""
    size_m = costmap.resolution_m
    rows, columns = costmap.costs.shape
    row = int((map_from_base.y_m - costmap.origin_y_m) / size_m)
    column = int((map_from_base.x_m - costmap.origin_x_m) / size_m)
    radius = round(COSTMAP_RADIUS_M / size_m)
    top, left = min(max(row - radius, 0), rows), min(max(column - radius, 0), columns)
    part = np.s_[top : max(row + radius, top), left : max(column + radius, left)]
    return replace(
        costmap,
        costs=costmap.costs[part],
        squared_cells=costmap.squared_cells[part],
        origin_x_m=costmap.origin_x_m + left * size_m,
        origin_y_m=costmap.origin_y_m + top * size_m,
    )
