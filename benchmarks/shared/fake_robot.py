"""A fake robot for tests of the page: real bus and real messages, no hardware and no simulator.

It drives in a circle in a room of 4 x 3 m, so that every layer of the map has data, and keeps every request.
"""

import io
import json
import math
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from benchmarks.shared.telemetry import telemetry_sample
from PIL import Image

from thumper.board.board import TelemetrySample
from thumper.board.messages import PARAMETERS, Fault, State
from thumper.bus.server import BusServer
from thumper.camera.frame import CameraFrame
from thumper.common.geometry import Pose2, Twist2
from thumper.config.bus import BusOptions
from thumper.gps.fix import Fix, FixStatus
from thumper.imu.sample import ImuSample
from thumper.lidar.scan import Scan
from thumper.maps.annotations import Annotations, parse_feature
from thumper.maps.cell_changes import CellBox
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.ros.codec import Message
from thumper.ros.markers import object_markers
from thumper.ros.service import json_object
from thumper.ros.services import ExperimentState
from thumper.ros.status import Status
from thumper.ros.to_ros import INFO, WARN, Messages, map_change, text
from thumper.runtime.requests import (
    EmergencyStop,
    Heartbeat,
    Query,
    Request,
    RobotCommand,
    SimulatorCommand,
    Velocity,
)
from thumper.runtime.service import board_parameters
from thumper.runtime.service.request_queue import RequestQueue

PERIOD_S = 0.1
WIDTH_M, HEIGHT_M, CELL_M = 4.0, 3.0, 0.05
BEAMS = 682
ANSWERS = {  # to commands
    "arm": "armed; the wheels hold still",
    "explore": "exploring: explore",
    "clear_fault": "fault cleared; the motors are off",
}
BASE_FROM_LASER = Pose2(x_m=0.12)


def room() -> OccupancyGrid:
    """Return a closed room with a box in it."""
    cells = np.full((80, 100), -1, dtype=np.int8)
    cells[10:70, 10:90] = 0
    for row in (10, 69):
        cells[row, 10:90] = 100
    for column in (10, 89):
        cells[10:70, column] = 100
    cells[50:58, 60:70] = 100
    return OccupancyGrid(cells=cells, resolution_m=CELL_M, origin_x_m=-0.5, origin_y_m=-0.5)


@dataclass
class FakeRobot:
    """One robot on a bus at `address`; `received` holds every request with its time, newest last."""

    address: str
    simulated: bool = True
    token: str = ""
    state: State = State.CLOSED_LOOP  # of a board without a fault
    fault: Fault = Fault.NONE
    fault_words: str = ""
    fault_cure: str = ""
    recording: bool = False
    goal: Pose2 | None = None
    battery_V: float = 7.62
    reason: str = ""  # empty: that of its goal
    pose_lost: str = ""
    localization: str = "mapping"
    received: list[tuple[float, Request]] = field(default_factory=list)
    parameters: dict[str, float] = field(default_factory=dict)
    simulated_faults: dict[str, Any] = field(default_factory=dict)
    simulated_world: str = "lab"
    simulated_speed: float = 1.0
    period_s: float = PERIOD_S
    lidar_scans: int = 567
    experiment: str = ""  # the one that runs
    experiment_result: str = ""  # of the one before
    experiment_lines: tuple[str, ...] = ("left: 3 rad/s",)
    has_sensors: bool = False  # a BNO08x, a GPS receiver, and a camera with a detector
    annotations: Annotations = field(default_factory=Annotations)
    grid: OccupancyGrid = field(default_factory=room)

    def __post_init__(self) -> None:
        self.reset()
        self._requests = RequestQueue()
        self._bus = BusServer(
            "thumper", BusOptions(address=self.address, token=self.token), self._requests, lambda text: None
        )
        self._messages = Messages()
        self._stop = threading.Event()
        self._map: Message | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Disconnect from the bus."""
        self._stop.set()
        self._thread.join()
        self._bus.close()

    def reset(self) -> None:
        """Forget all requests and faults."""
        self.received.clear()
        self.fault, self.fault_words, self.fault_cure = Fault.NONE, "", ""
        if self.annotations:
            self.annotate(Annotations())
        self.reason = self.pose_lost = ""
        self.localization = "mapping"
        self.goal, self.recording, self.battery_V, self.lidar_scans = None, False, 7.62, 567
        self.recording_paused = False
        self.state = State.CLOSED_LOOP
        self.simulated_speed = 1.0
        self.simulated_faults, self.experiment, self.has_sensors = {}, "", False
        self.experiment_result, self.experiment_lines = "", ("left: 3 rad/s",)
        self.simulated_world = "lab"
        self.grid = room()
        self.parameters = {spec.name: spec.default for spec in PARAMETERS}

    def received_of(self, kind: type[Any]) -> list[Any]:
        """Return the requests of one type so far."""
        return [request for _, request in self.received if isinstance(request, kind)]

    def last_s(self, kind: type[Any]) -> float:
        """Return when the newest request of a type came [s, monotonic]."""
        return max((at_s for at_s, request in self.received if isinstance(request, kind)), default=-math.inf)

    def pose_at(self, cycle: int) -> Pose2:
        """Return the pose in a cycle."""
        angle = 0.025 * cycle
        return Pose2(
            x_m=2.0 + 0.8 * math.cos(angle), y_m=1.5 + 0.6 * math.sin(angle), theta_rad=angle + math.pi / 2
        )

    def event(self, text: str, level: int = INFO) -> None:
        """Publish a line of the log."""
        self._send("events", self._messages.event(time.time(), level, text))

    def _run(self) -> None:
        cycle, due_s = 0, time.monotonic()
        self.event("the robot is there")
        while not self._stop.wait(max(0.0, due_s - time.monotonic())):
            due_s += self.period_s
            for at_s, request in self._requests.take_all():
                self.received.append((at_s, request))
                self._handle(request)
            self._publish(cycle)
            cycle += 1

    def _handle(self, request: Request) -> None:
        match request:
            case EmergencyStop():
                self.fault, self.goal, self.state = Fault.E_STOP, None, State.DISARMED
                self.fault_words, self.fault_cure = "emergency stop", "the emergency stop was pressed"
                self.event("emergency stop", WARN)
            case RobotCommand(name=name):
                self._run_command(name)
            case Query():
                try:
                    found = self._answer_about_map(request.name, request.content)
                    found = found or self._answer(request.name, request.content)
                    answer: dict[str, Any] = {"ok": True, **found}
                except ValueError as error:
                    answer = {"ok": False, "error": str(error)}
                request.reply(answer)
            case Heartbeat() | Velocity() | SimulatorCommand():
                pass

    def _run_command(self, name: str) -> None:
        if name == "clear_fault":
            self.fault, self.fault_words, self.fault_cure = Fault.NONE, "", ""
        elif name in ("record_start", "record_stop"):
            self.recording = name == "record_start"
        elif name == "cancel":
            self.goal = None
        elif name in ("arm", "disarm"):
            self.state = State.CLOSED_LOOP if name == "arm" else State.DISARMED

    def _answer_about_map(self, name: str, content: Mapping[str, Any]) -> dict[str, Any]:
        if name == "annotation/add":
            self.annotate(self.annotations.with_item(parse_feature(content)))
            return {"text": "added"}
        if name == "annotation/remove":
            self.annotate(self.annotations.without(content["name"]))
            return {"text": "removed"}
        if name.startswith("library/"):
            return {"text": f"done: {name}", "maps": [], "recordings": [], "in_use": ""}
        return {"mission": 1} if name == "mission/follow" or "place" in content else {}

    def _change_simulation(self, content: Mapping[str, Any]) -> str:
        if "speed" in content:
            self.simulated_speed = content["speed"]
            return f"{self.simulated_speed:g} times real time"
        if "world" in content:
            self.simulated_world = content["world"]
            return f"the robot starts again in the world {self.simulated_world}"
        if "clear_faults" in content:
            self.simulated_faults.clear()
            return "removed all faults"
        self.simulated_faults[content["fault"]] = content["value"]
        return f"{content['fault']} is {content['value']}"

    def _answer(self, name: str, content: Mapping[str, Any]) -> dict[str, Any]:
        answer: dict[str, Any] = {}
        match name:
            case "parameters/schema":
                answer = json_object(board_parameters.schema())
            case "parameters/get" | "parameters/revert":
                answer = {"values": self.parameters}
            case "parameters/set":
                for key, value in content.items():
                    spec = next(spec for spec in PARAMETERS if spec.name == key)
                    if not spec.minimum <= value <= spec.maximum:
                        raise ValueError(f"the board refused {key} = {value:g}")
                self.parameters.update(content)
                answer = {"values": {key: self.parameters[key] for key in content}}
            case "parameters/save":
                pass
            case "command":
                self._run_command(content["command"])
                answer = {"text": ANSWERS.get(content["command"], f"done: {content['command']}")}
            case "simulator/world":
                kinds = {
                    "lidar": {"choices": ["ok", "unplugged"], "title": "Lidar: plug"},
                    "slip.left": {"most": 1.0, "unit": "", "normal": 0.0, "title": "Left wheels: slip"},
                    "robot.carried": {"pose": True, "title": "Robot: carried away"},
                }
                answer = {"faults": kinds, "on": self.simulated_faults, "pillars": 0}
                answer |= {"world": self.simulated_world, "worlds": ["hall", "lab"]}
                answer["titles"] = {"hall": "Hall: empty", "lab": "Laboratory: one room"}
                answer["speed"] = self.simulated_speed
            case "simulator/command":
                answer = {"text": self._change_simulation(content)}
            case "experiment/state":
                answer = json_object(
                    ExperimentState(
                        running=self.experiment,
                        share=0.2,
                        what="step 3" if self.experiment else self.experiment_result,
                        lines=[*self.experiment_lines, self.experiment_result],
                        problem="",
                        has_report=False,
                    )
                )
            case "mission/send":
                self.goal = Pose2(x_m=content["x_m"], y_m=content["y_m"], theta_rad=content.get("yaw_rad", 0))
                answer = {"mission": 1}
            case _:
                raise ValueError(f"no such service: {name}")
        return answer

    def annotate(self, annotations: Annotations) -> None:
        """Replace zones, places and tags, and publish them."""
        self.annotations = annotations
        self._send("annotations", text(json.dumps(annotations.to_geojson())))

    def _publish(self, cycle: int) -> None:
        now_s, messages = time.time(), self._messages
        pose = self.pose_at(cycle)
        self._send("pose", messages.pose(now_s, pose))
        self._send("scan", messages.scan(_scan(now_s, pose)))
        self._send("wheels", messages.wheels(self._telemetry(now_s, cycle)))
        self._send("cmd_vel", messages.twist(now_s, Twist2(v_m_s=0.2)))
        deviation = np.random.default_rng(cycle).normal(0.0, 0.04, (60, 3))
        self._send(
            "particles", messages.particles(now_s, deviation + np.array([pose.x_m, pose.y_m, pose.theta_rad]))
        )
        if self.goal is not None:
            path = np.linspace((pose.x_m, pose.y_m), (self.goal.x_m, self.goal.y_m), 20)
            self._send("plan", messages.path(now_s, path))
            self._send("local_plan", messages.path(now_s, path[:6] + 0.03))
        if cycle % 10 == 0:
            self._publish_map(messages.grid(now_s, self.grid))
        if self.has_sensors:
            self._publish_sensors(now_s, pose)
        self._send("status", messages.status(self._status(now_s, pose)))

    def _publish_map(self, new: Message) -> None:
        """Publish the map, and the box of cells in which it differs from the one before."""
        before, self._map = self._map, new
        changed = None
        if before is not None and before.info.origin == new.info.origin and before.data.size == new.data.size:
            shape = new.info.height, new.info.width
            differs = np.argwhere((before.data != new.data).reshape(shape))
            low, high = (differs.min(axis=0), differs.max(axis=0) + 1) if len(differs) else ((0, 0), (0, 0))
            changed = CellBox(int(low[0]), int(low[1]), int(high[0]), int(high[1]))
        self._send("map", new)
        self._send("map_changes", map_change(before, new, changed))

    def _publish_sensors(self, now_s: float, pose: Pose2) -> None:
        self._send("objects", object_markers(self._messages, now_s, [("chair", 1.0, 0.5)]))
        fix = Fix(
            time_s=now_s,
            status=FixStatus.RTK,
            latitude_deg=48.2625018,
            longitude_deg=11.6681078,
            altitude_m=525.9,
            variances_m2=(0.0004, 0.0001, 0.0009),
        )
        imu = ImuSample(
            time_s=now_s,
            yaw_rate_rad_s=0.25,
            roll_rad=0.0,
            pitch_rad=0.1,
            yaw_rad=1.0,
            acceleration_m_s2=(-0.04, 0.2, 9.8),
        )
        self._send("imu", self._messages.imu(imu))
        self._send("gps", self._messages.fix(fix))
        self._send("gps_odom", self._messages.fix_in_map(fix, pose.x_m + 0.1, pose.y_m))
        self._send("camera", self._messages.image(CameraFrame(time_s=now_s, jpeg=_jpeg())))

    def _telemetry(self, now_s: float, cycle: int) -> TelemetrySample:
        goal_mrad_s = 3000 if cycle % 80 < 50 else 0
        left = round(goal_mrad_s * (1 - math.exp(-(cycle % 80) / 4))) if goal_mrad_s else 0
        return telemetry_sample(
            now_s,
            time_us=cycle * 100_000,
            left_count=cycle * 40,
            left_speed=left + (cycle * 37) % 90 - 45,
            left_setpoint=goal_mrad_s,
            left_pwm=left // 40,
            left_integral=left // 2,
            right_count=cycle * 41,
            right_speed=left + (cycle * 53) % 90 - 45,
            right_setpoint=goal_mrad_s,
            right_pwm=left // 38,
            right_integral=left // 2,
            battery_mV=round(1000 * self.battery_V),
            left_current_mA=900,
            right_current_mA=950,
            state=State.FAULT if self.fault else self.state,
            fault=self.fault,
            warnings=int(self.battery_V < 7.0),
            rx_frames=cycle % 65536,
            rx_errors=2,
            tx_dropped=0,
        )

    def _status(self, now_s: float, pose: Pose2) -> Status:
        goal = self.goal
        return Status(
            time_s=now_s,
            robot="thumper",
            mode="driving" if goal else "idle",
            reason=self.reason or ("following the plan" if goal else "waiting for a goal"),
            simulated=self.simulated,
            recording=self.recording,
            recording_paused=self.recording_paused,
            has_goal=goal is not None,
            goal_x_m=goal.x_m if goal else 0.0,
            goal_y_m=goal.y_m if goal else 0.0,
            goal_yaw_rad=goal.theta_rad if goal else 0.0,
            distance_to_goal_m=pose.distance_m(goal) if goal else 0.0,
            board_state=State.FAULT.name if self.fault else self.state.name,
            fault=int(self.fault),
            fault_words=self.fault_words,
            fault_cure=self.fault_cure,
            loop_late_s=0.0012,
            loop_busy_s=0.013,
            telemetry_age_s=0.04,
            scan_age_s=0.08,
            link_frames=1234,
            link_errors=2,
            lidar_scans=self.lidar_scans,
            pose_lost=self.pose_lost,
            localization=self.localization,
        )

    def _send(self, topic: str, message: Any) -> None:
        self._bus.publish(topic, time.time(), message)


def _jpeg() -> bytes:
    content = io.BytesIO()
    Image.new("RGB", (64, 48), (30, 120, 60)).save(content, "JPEG")
    return content.getvalue()


def _scan(now_s: float, pose: Pose2) -> Scan:
    """Simulate a scan of the room's four walls."""
    laser = pose @ BASE_FROM_LASER
    angles_rad = -2.0862 + 0.0061359 * np.arange(BEAMS)
    headings = laser.theta_rad + angles_rad
    with np.errstate(divide="ignore"):
        along_x = np.where(np.cos(headings) > 0, WIDTH_M - laser.x_m, -laser.x_m) / np.cos(headings)
        along_y = np.where(np.sin(headings) > 0, HEIGHT_M - laser.y_m, -laser.y_m) / np.sin(headings)
    return Scan(
        time_s=now_s,
        ranges_m=np.minimum(along_x, along_y),
        angle_min_rad=-2.0862,
        angle_increment_rad=0.0061359,
        time_increment_s=0.0,
        range_min_m=0.02,
        range_max_m=5.6,
    )
