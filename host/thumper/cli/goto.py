"""`thumper goto`, `thumper stop`: send a running robot to a goal, or stop it."""

import math
import time
from typing import TYPE_CHECKING, Annotated

import typer

from thumper.cli.options.bus import connect
from thumper.cli.options.common import BusAddress, ClearFault, ConfigFile, GoalTolerance, RobotName

if TYPE_CHECKING:
    from thumper.bus.client import BusClient
    from thumper.ros.services import MissionStatus

POLL_PERIOD_S = 0.2
LINE_PERIOD_S = 1.0


def _number(text: str) -> float:
    """Parse a coordinate. Unknown options arrive here, too, because coordinates may be negative."""
    try:
        return float(text)
    except ValueError as error:
        raise typer.BadParameter(f"{text!r} is neither a number nor an option of `thumper goto`") from error


def goto(
    x: Annotated[float, typer.Argument(help="X in the map [m].", parser=_number)],
    y: Annotated[float, typer.Argument(help="Y in the map [m].", parser=_number)],
    yaw: Annotated[
        float | None, typer.Argument(help="Heading at the goal [degrees from x].", parser=_number)
    ] = None,
    tolerance: GoalTolerance = 0.1,
    wait: Annotated[bool, typer.Option(help="Wait until the drive ends.")] = True,
    clear_fault: ClearFault = False,
    config: ConfigFile = None,
    bus: BusAddress = "",
    robot: RobotName = "",
) -> None:
    """Send a running robot to a goal and wait until it arrives. Ctrl-C cancels the goal.

    Exits with 1 if the goal is rejected or not reached.

    Example: `thumper goto 1.5 -0.5 90`
    """
    from thumper.common.errors import EXIT_INTERRUPTED, EXIT_USAGE, ThumperError
    from thumper.navigation.goal import check_place
    from thumper.ros import services
    from thumper.ros.services import RunCommand, SendMission

    numbers = (x, y, yaw or 0.0, tolerance)
    if not all(map(math.isfinite, numbers)):
        raise ThumperError("the goal and --tolerance must be finite numbers", exit_code=EXIT_USAGE)
    check_place("the goal", x, y)
    yaw_rad = None if yaw is None else math.radians(yaw)
    goal = SendMission(x_m=x, y_m=y, yaw_rad=yaw_rad, tolerance_m=tolerance)
    with connect(config, bus, robot) as client:
        if clear_fault:
            services.COMMAND.call(client, RunCommand(command="clear_fault"))
        try:
            mission = services.MISSION_SEND.call(client, goal).mission
            if not wait:
                print(f"mission {mission} started")
                return
            state = _wait(client, mission)
        except KeyboardInterrupt:
            services.COMMAND.call(client, RunCommand(command="cancel"))
            raise ThumperError(
                "interrupted: goal cancelled; the robot stops", exit_code=EXIT_INTERRUPTED
            ) from None
    if state.state != "reached":
        raise ThumperError(f"goal not reached: {state.reason}")
    print(f"reached: {state.reason}")


def _wait(client: "BusClient", mission: int) -> "MissionStatus":
    """Print the remaining distance until the mission ends; return its final state."""
    from thumper.ros import services
    from thumper.ros.services import FindMission

    begun_s = next_line_s = time.monotonic()
    while (state := services.MISSION_STATE.call(client, FindMission(mission=mission))).state == "driving":
        now_s = time.monotonic()
        if now_s >= next_line_s:
            next_line_s += LINE_PERIOD_S
            reason = f": {state.reason}" if state.reason else ""
            print(f"{state.distance_m:5.2f} m to go, {now_s - begun_s:5.1f} s{reason}", flush=True)
        time.sleep(POLL_PERIOD_S)
    return state


def stop(
    emergency: Annotated[
        bool,
        typer.Option(
            "--emergency", help="Switch the motors off at once; latched until the fault is cleared."
        ),
    ] = False,
    config: ConfigFile = None,
    bus: BusAddress = "",
    robot: RobotName = "",
) -> None:
    """Cancel the running robot's goal or manual drive and stop it.

    Example: `thumper stop --emergency`
    """
    from thumper.ros import services
    from thumper.ros.codec import message
    from thumper.ros.services import RunCommand

    with connect(config, bus, robot) as client:
        if emergency:  # published first: the topic overtakes all queries
            client.publish("estop", message("std_msgs/msg/Bool", data=True))
        command = RunCommand(command="estop" if emergency else "cancel")
        print(services.COMMAND.call(client, command).text)
