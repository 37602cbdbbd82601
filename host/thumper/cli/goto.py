"""`thumper goto`, `thumper stop`: send a running robot somewhere, or stop it."""

import math
import time
from typing import TYPE_CHECKING, Annotated

import typer

from thumper.cli.bus_options import Address, Config, Robot, join

if TYPE_CHECKING:
    from thumper.bus.client import BusClient

LOOK_PERIOD_S = 0.2
LINE_PERIOD_S = 1.0


def _number(text: str) -> float:
    """Read a coordinate; as those may be negative, an option that does not exist comes here, too."""
    try:
        return float(text)
    except ValueError as error:
        raise typer.BadParameter(f"{text!r} is no number, and no option of `thumper goto`") from error


def goto(
    x: Annotated[float, typer.Argument(help="X in the map [m].", parser=_number)],
    y: Annotated[float, typer.Argument(help="Y in the map [m].", parser=_number)],
    yaw: Annotated[
        float | None, typer.Argument(help="Which way to look there [degrees from x].", parser=_number)
    ] = None,
    tolerance: Annotated[float, typer.Option(help="How near is near enough [m].", min=0.02, max=1.0)] = 0.1,
    wait: Annotated[bool, typer.Option(help="Wait until the robot is there.")] = True,
    clear_fault: Annotated[bool, typer.Option(help="Clear a fault that the board has latched.")] = False,
    config: Config = None,
    bus: Address = "",
    robot: Robot = "",
) -> None:
    """Send a running robot to a goal and wait until it is there. Ctrl-C cancels the goal.

    Leaves with 1 when the goal is refused or not reached.
    """
    from thumper.common.errors import EXIT_INTERRUPTED, EXIT_USAGE, ThumperError
    from thumper.navigation.goal import check_place

    numbers = (x, y, yaw or 0.0, tolerance)
    if not all(map(math.isfinite, numbers)):
        raise ThumperError("the goal and --tolerance take finite numbers", exit_code=EXIT_USAGE)
    check_place("the goal", x, y)
    goal = {"x_m": x, "y_m": y, "tolerance_m": tolerance}
    if yaw is not None:
        goal["yaw_rad"] = math.radians(yaw)
    with join(config, bus, robot) as client:
        if clear_fault:
            client.query("command", {"command": "clear_fault"})
        mission = client.query("mission/send", goal)["mission"]
        if not wait:
            print(f"mission {mission} is under way")
            return
        try:
            state = _wait(client, mission)
        except KeyboardInterrupt:
            client.query("command", {"command": "cancel"})
            raise ThumperError(
                "interrupted: the goal is cancelled, the robot stops", exit_code=EXIT_INTERRUPTED
            ) from None
    if state["state"] != "reached":
        raise ThumperError(f"goal not reached: {state['reason']}")
    print(f"reached: {state['reason']}")


def _wait(client: "BusClient", mission: int) -> dict[str, object]:
    """Show how far it still is, until the mission is over."""
    begun_s = next_line_s = time.monotonic()
    while (state := client.query("mission/state", {"mission": mission}))["state"] == "driving":
        now_s = time.monotonic()
        if now_s >= next_line_s:
            next_line_s += LINE_PERIOD_S
            why = f": {state['reason']}" if state["reason"] else ""
            print(f"{state['distance_m']:5.2f} m to go, {now_s - begun_s:5.1f} s{why}", flush=True)
        time.sleep(LOOK_PERIOD_S)
    return state


def stop(
    emergency: Annotated[
        bool, typer.Option("--emergency", help="Motors off at once, and latched until the fault is cleared.")
    ] = False,
    config: Config = None,
    bus: Address = "",
    robot: Robot = "",
) -> None:
    """Cancel what a running robot does and stop it."""
    from thumper.ros.codec import message

    with join(config, bus, robot) as client:
        if emergency:
            client.publish("estop", message("std_msgs/msg/Bool", data=True))  # it goes before all questions
        print(client.query("command", {"command": "estop" if emergency else "cancel"})["text"])
