"""`thumper status`, `thumper watch`: what a running robot says of itself."""

import json
import sys
import threading
from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Annotated, Any

import typer

from thumper.cli.bus_options import Address, Config, Robot, join

if TYPE_CHECKING:
    import queue

STATUS_TIMEOUT_S = 3.0
LOOK_PERIOD_S = 0.5
MOST_WAITING = 100


def status(
    as_json: Annotated[bool, typer.Option("--json", help="Print everything as one JSON object.")] = False,
    config: Config = None,
    bus: Address = "",
    robot: Robot = "",
) -> None:
    """Tell what a running robot does, whether it maps or localises, and how its parts keep up."""
    from thumper.common.errors import EXIT_NOT_THERE, ThumperError
    from thumper.ros.to_json import to_json

    heard = threading.Event()
    newest: list[Any] = []

    def take(message: Any) -> None:
        newest.append(message)
        heard.set()

    with join(config, bus, robot) as client:
        client.subscribe("status", take)
        if not heard.wait(STATUS_TIMEOUT_S):
            raise ThumperError(
                "the robot is on the bus but says nothing; is its board connected, and is --robot its name?",
                exit_code=EXIT_NOT_THERE,
            )
        mapping: dict[str, Any] = {}
        with suppress(ThumperError):  # while it looks for its board, it answers nothing
            mapping = client.query("mapping/state")
            del mapping["ok"]
    message = newest[-1]
    if as_json:
        print(json.dumps({**to_json(message), "mapping": mapping}))
    else:
        print(_in_words(message, mapping))


def _in_words(of: Any, mapping: Mapping[str, str]) -> str:
    lines = [
        f"{of.robot} ({'SIMULATED' if of.simulated else 'REAL'}): {of.mode}"
        + (f", {of.reason}" if of.reason else "")
    ]
    if of.has_goal:
        lines.append(f"goal     ({of.goal_x_m:.2f}, {of.goal_y_m:.2f}), {of.distance_to_goal_m:.2f} m to go")
    if mapping:
        lines.append("mode     " + "; ".join(filter(None, map(mapping.get, ("mode", "lost", "map_doubt")))))
    lines.append(f"board    {of.board_state.lower().replace('_', ' ')}")
    if of.fault:
        lines.append(f"fault    {of.fault}, {of.fault_words}: {of.fault_cure}")
    lines += [
        f"link     {of.link_errors} bad frames, {of.lost_edges} lost encoder edges, "
        f"telemetry {max(0.0, 1e3 * of.telemetry_age_s):.0f} ms old",
        f"lidar    {of.lidar_scans} scans, {of.lidar_errors} errors, {of.lidar_restarts} restarts, "
        f"scan {max(0.0, 1e3 * of.scan_age_s):.0f} ms old",
        f"loop     {1e3 * of.loop_late_s:.1f} ms late, busy for {1e3 * of.loop_busy_s:.1f} ms",
        f"recording {'on' if of.recording else 'off'}",
    ]
    return "\n".join(lines)


def watch(
    topic: Annotated[str, typer.Argument(help="Which topic; docs/operate.md lists them.")],
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object a line.")] = False,
    count: Annotated[int, typer.Option(help="End after so many messages; 0: at Ctrl-C.", min=0)] = 0,
    config: Config = None,
    bus: Address = "",
    robot: Robot = "",
) -> None:
    """Print the messages of a topic of a running robot as they come."""
    import queue

    from thumper.bus.heartbeat_sender import HeartbeatSender
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.ros.to_json import to_json
    from thumper.ros.to_text import message_text
    from thumper.ros.topics import TOPICS

    if topic not in TOPICS:
        raise ThumperError(f"no topic {topic!r}; there are {', '.join(TOPICS)}", exit_code=EXIT_USAGE)
    waiting: queue.Queue[Any] = queue.Queue(MOST_WAITING)
    with join(config, bus, robot) as client:
        client.subscribe(topic, lambda message: _leave(waiting, message))
        pulse = HeartbeatSender(client)
        shown, waits = 0, False
        try:
            while not count or shown < count:
                try:
                    message = waiting.get(timeout=LOOK_PERIOD_S)
                except queue.Empty:
                    if pulse.has_talked and not (shown or waits):
                        waits = True
                        told = f"robot {client.robot!r} is there, nothing on {topic} yet; Ctrl-C ends it"
                        print(f"thumper: {told}", file=sys.stderr)
                    pulse.check()
                    continue
                print(json.dumps(to_json(message)) if as_json else message_text(message), flush=True)
                shown += 1
        except KeyboardInterrupt:
            pass


def _leave(waiting: "queue.Queue[Any]", message: Any) -> None:
    """A terminal that is too slow misses messages; it must not gather them."""
    if not waiting.full():
        waiting.put_nowait(message)
