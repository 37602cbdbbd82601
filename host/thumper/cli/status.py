"""`thumper status`, `thumper watch`: show the state and the messages of a running robot."""

import json
import math
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

from thumper.cli.options.bus import connect
from thumper.cli.options.common import AsJson, BusAddress, ConfigFile, RobotName
from thumper.cli.output.stderr_report import report_to_stderr
from thumper.ros.topics import TOPICS

if TYPE_CHECKING:
    import queue

    from thumper.bus.client import BusClient

STATUS_TIMEOUT_S = 3.0
LIVE_TIMEOUT_S = 1.0  # for pose and battery, which come at 10 Hz from a robot with a board
POLL_PERIOD_S = 0.5
GOAL_FIELDS = ("goal_x_m", "goal_y_m", "goal_yaw_rad", "distance_to_goal_m")
MAX_QUEUED = 100
DECIMALS = 9  # of a number in JSON; a latitude needs 8


def status(
    as_json: AsJson = False, config: ConfigFile = None, bus: BusAddress = "", robot: RobotName = ""
) -> None:
    """Show what a running robot does: mode, goal, pose, battery, board, lidar, control loop, recording.

    Without a goal, the goal's fields in the JSON are null; so are pose and battery if they do not arrive.

    Examples:

    - `thumper status`
    - `thumper status --bus 192.168.1.20:7448 --json`
    """
    from thumper.common.errors import EXIT_NOT_THERE, ThumperError
    from thumper.ros import services

    topics = ("status", "pose", "battery")
    newest: dict[str, Any] = {}
    received = {topic: threading.Event() for topic in topics}

    def keep(topic: str, message: Any) -> None:
        newest[topic] = message
        received[topic].set()

    with connect(config, bus, robot) as client:
        for topic in topics:
            client.subscribe(topic, partial(keep, topic))
        if not received["status"].wait(STATUS_TIMEOUT_S):
            raise ThumperError(
                "the robot is on the bus but sends no status; check that its board is connected and that "
                "--robot is its name",
                exit_code=EXIT_NOT_THERE,
            )
        until_s = time.monotonic() + LIVE_TIMEOUT_S
        mapping: dict[str, Any] = {}
        wheels: dict[str, Any] = {}
        with suppress(ThumperError):  # a robot that waits for its board answers no queries
            mapping = asdict(services.MAPPING_STATE.call(client))
            wheels = asdict(services.WHEELS_STATE.call(client))
        for topic in topics:
            received[topic].wait(max(0.0, until_s - time.monotonic()))
    live = _live(newest)
    if as_json:
        print(
            json.dumps(
                {**_status_json(newest["status"]), **live, "mapping": mapping, "wheel_estimate": wheels}
            )
        )
    else:
        print(_status_text(newest["status"], live, mapping, wheels))


def _live(newest: Mapping[str, Any]) -> dict[str, Any]:
    """Return pose and battery voltage of the newest messages; None for one that is missing or unknown."""
    from thumper.ros.from_ros import pose_of

    pose = pose_of(newest["pose"].pose.pose) if "pose" in newest else None
    battery = newest.get("battery")
    return {
        "pose": pose and {"x_m": pose.x_m, "y_m": pose.y_m, "heading_rad": pose.theta_rad},
        "battery_V": round(battery.voltage, 3) if battery is not None and battery.present else None,
    }


def _status_json(status: Any) -> dict[str, Any]:
    """Return the status as JSON; the goal's fields are None without a goal."""
    from thumper.ros.to_json import to_json

    content: dict[str, Any] = to_json(status)
    if not status.has_goal:
        content |= dict.fromkeys(GOAL_FIELDS)
    return content


def _status_text(
    message: Any, live: Mapping[str, Any], mapping: Mapping[str, str], wheels: Mapping[str, Any]
) -> str:
    from thumper.board.fault_texts import STATE_NAMES
    from thumper.common.texts import place_text
    from thumper.ros.to_text import mode_word

    m = message
    lines = [
        f"{m.robot} ({'SIMULATED' if m.simulated else 'REAL'}): {mode_word(m)}"
        + (f", {m.reason}" if m.reason else "")
    ]
    if m.has_goal:
        lines.append(f"goal     {place_text(m.goal_x_m, m.goal_y_m)}, {m.distance_to_goal_m:.2f} m to go")
    if pose := live["pose"]:
        heading_deg = math.degrees(pose["heading_rad"])
        lines.append(f"pose     {place_text(pose['x_m'], pose['y_m'])} m, heading {heading_deg:z.0f} degrees")
    if live["battery_V"] is not None:
        lines.append(f"battery  {live['battery_V']:.2f} V")
    if mapping:
        lines.append(f"mode     {mode_text(mapping)}")
        lines += [f"earth    {text}"] if (text := earth_text(mapping)) else []
    lines.append(f"board    {STATE_NAMES.get(m.board_state, 'no answer')}")
    if m.fault:
        lines.append(f"fault    {m.fault_words}: {m.fault_cure}")
    if wheels:
        lines.append("wheels   " + "; ".join(filter(None, (wheels["text"], wheels["drift"]))))
    lines += [
        f"link     {m.link_errors} bad frames, {m.lost_edges} lost encoder edges, "
        f"telemetry {max(0.0, 1e3 * m.telemetry_age_s):.0f} ms old",
        f"lidar    {m.lidar_scans} scans, {m.lidar_errors} errors, {m.lidar_restarts} restarts, "
        f"scan {max(0.0, 1e3 * m.scan_age_s):.0f} ms old",
        *("{:<8}{}".format(*line.split(":", 1)) for line in m.sensors.splitlines()),
        f"loop     {1e3 * m.loop_late_s:.1f} ms late, busy for {1e3 * m.loop_busy_s:.1f} ms",
        f"recording {recording_text(m)}",
    ]
    return "\n".join(lines)


def recording_text(status: Any) -> str:
    """Return whether the robot records."""
    if status.recording_paused:
        return "paused until the disk has room"
    return "on" if status.recording else "off"


def mode_text(mapping: Mapping[str, str]) -> str:
    """Return the SLAM mode, and whether the robot knows its pose."""
    mode, lost = mapping["mode"], mapping["lost"]
    if mode != "mapping":
        mode += ", searching for the pose" if lost else ", pose found"
    return "; ".join(filter(None, (mode, lost or mapping["map_doubt"])))


def earth_text(mapping: Mapping[str, str]) -> str:
    """Return the map's place on Earth, and what the GPS lacks; empty without either."""
    gps = mapping["gps"]
    return "; ".join(filter(None, (mapping["datum"], "" if gps in ("off", "ok") else gps)))


def _topics() -> list[str]:
    return list(TOPICS)


def watch(
    topic: Annotated[
        str, typer.Argument(help=f"Name of a topic: {', '.join(_topics())}.", autocompletion=_topics)
    ],
    as_json: AsJson = False,
    count: Annotated[int, typer.Option(help="Stop after this many messages; 0: at Ctrl-C.", min=0)] = 0,
    config: ConfigFile = None,
    bus: BusAddress = "",
    robot: RobotName = "",
) -> None:
    """Print the messages of a running robot's topic as they arrive; with --json, one object per line.

    If the robot stops, the command says so, and goes on when the robot returns.

    Example: `thumper watch pose --count 10`
    """
    import queue

    from thumper.bus.status_watchdog import StatusWatchdog
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.common.texts import choice_hint
    from thumper.ros.to_json import to_json
    from thumper.ros.to_text import message_text

    if topic not in TOPICS:
        raise ThumperError(f"unknown topic {topic!r}; {choice_hint(topic, _topics())}", exit_code=EXIT_USAGE)
    received: queue.Queue[Any] = queue.Queue(MAX_QUEUED)
    with connect(config, bus, robot) as client:
        client.subscribe(topic, lambda message: _enqueue(received, message))
        heartbeat = StatusWatchdog(client, report_to_stderr)
        printed, hint_printed = 0, False
        try:
            while not count or printed < count:
                try:
                    message = received.get(timeout=POLL_PERIOD_S)
                except queue.Empty:
                    if heartbeat.has_received and not (printed or hint_printed):
                        hint_printed = True
                        why = _why_silent(client, topic)
                        hint = f"robot {client.robot!r} is running; no messages on {topic} yet{why}"
                        report_to_stderr(f"{hint} (Ctrl-C to stop)")
                    heartbeat.check()
                    continue
                heartbeat.check()
                print(_json(to_json(message)) if as_json else message_text(message), flush=True)
                printed += 1
        except KeyboardInterrupt:
            pass


def _json(content: Any) -> str:
    """Return a message as JSON, without digits that no sensor resolves: 4.99e-10 m/s is 0."""
    return json.dumps(
        json.loads(json.dumps(content), parse_float=lambda text: round(float(text), DECIMALS) + 0.0)
    )


def _why_silent(client: "BusClient", topic: str) -> str:
    """Return why nothing comes on a topic, as far as the robot knows it."""
    from thumper.common.errors import ThumperError
    from thumper.ros import services

    if topic not in ("gps", "gps_odom"):
        return ""
    gps = "ok"
    with suppress(ThumperError):  # a robot that waits for its board answers no queries
        gps = services.MAPPING_STATE.call(client).gps
    if gps == "off":
        return ": it has no GPS ([gps] enabled = true in its configuration)"
    return f": {gps}" if gps != "ok" and topic == "gps_odom" else ""


def _enqueue(messages: "queue.Queue[Any]", message: Any) -> None:
    """Queue a message; drop it if the queue is full, so that a slow terminal cannot fill the memory."""
    if not messages.full():
        messages.put_nowait(message)
