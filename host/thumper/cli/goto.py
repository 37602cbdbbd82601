"""`thumper goto`, `thumper stop`: send a running robot to a goal, or stop it."""

import json
import math
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Annotated

import typer

from thumper.cli.options.bus import connect
from thumper.cli.options.common import BusAddress, ClearFault, ConfigFile, GoalTolerance, RobotName
from thumper.common.texts import is_number

if TYPE_CHECKING:
    from thumper.bus.client import BusClient
    from thumper.ros.services import MissionStatus, SendMission

POLL_PERIOD_S = 0.2
FULL_TURN_DEG = 360.0


def _number(text: str) -> float:
    """Parse a coordinate."""
    if not is_number(text):
        raise typer.BadParameter(f"{text!r} is not a number")
    return float(text)


def _places(context: typer.Context, incomplete: str) -> list[str]:
    """Return what Tab offers: the places of the running robot's map; nothing without a robot."""
    from thumper.common.errors import ThumperError
    from thumper.maps.annotations import annotations_of

    config, bus, robot = (context.params.get(name) for name in ("config", "bus", "robot"))
    with suppress(ThumperError, ValueError), connect(config, bus or "", robot or "") as client:
        if message := client.newest("annotations"):
            places = annotations_of(json.loads(message.data)).places
            return [place.name for place in places if place.name.startswith(incomplete)]
    return []


def goto(
    x: Annotated[
        str,
        typer.Argument(
            metavar="X|PLACE",
            help="X in the map [m], or the name of a place.",
            autocompletion=_places,
        ),
    ] = "",
    y: Annotated[float | None, typer.Argument(help="Y in the map [m].", parser=_number)] = None,
    heading: Annotated[
        float | None,
        typer.Argument(help="Heading at the goal, -360 to 360 [degrees from x].", parser=_number),
    ] = None,
    gps: Annotated[
        tuple[float, float] | None,
        typer.Option("--gps", metavar="LAT LON", help="Goal on Earth, in degrees, instead of X Y."),
    ] = None,
    object_: Annotated[
        str, typer.Option("--object", metavar="NAME", help="Object that the robot has seen, such as chair.")
    ] = "",
    tolerance: GoalTolerance = 0.1,
    wait: Annotated[bool, typer.Option(help="Wait until the drive ends.")] = True,
    clear_fault: ClearFault = False,
    config: ConfigFile = None,
    bus: BusAddress = "",
    robot: RobotName = "",
) -> None:
    """Send a running robot to a goal or a saved place and wait until it arrives. Ctrl-C cancels the goal.

    Exits with 1 if the goal is rejected or not reached.

    Examples:

    - `thumper goto 1.5 -0.5 90`
    - `thumper goto kitchen`
    - `thumper goto --gps 48.26243 11.66810`
    - `thumper goto --object chair`
    """
    from thumper.common.errors import EXIT_INTERRUPTED, EXIT_USAGE, ThumperError
    from thumper.ros import services
    from thumper.ros.services import RunCommand, SendMission

    if gps is not None and not object_:
        goal = _on_earth(gps, tolerance, is_alone=not x)
    elif object_:
        if x or gps is not None:
            raise ThumperError("--object is the goal: leave out X, Y, PLACE and --gps", exit_code=EXIT_USAGE)
        goal = SendMission(object=object_, tolerance_m=tolerance)
    elif not x:
        raise ThumperError(
            "pass a goal: X Y, the name of a place, --gps LAT LON or --object NAME", exit_code=EXIT_USAGE
        )
    elif y is None and len(numbers := x.replace(",", " ").split()) > 1 and all(map(is_number, numbers)):
        raise ThumperError(
            f"{x!r} is no place; write X Y with a space: thumper goto {' '.join(numbers)}",
            exit_code=EXIT_USAGE,
        )
    elif y is None and not is_number(x):
        goal = SendMission(place=x, tolerance_m=tolerance)
    elif not is_number(x):
        raise ThumperError(
            f"{x!r} is not a number; a goal is X Y or the name of a place", exit_code=EXIT_USAGE
        )
    else:
        goal = _position(float(x), y, heading, tolerance)
    with connect(config, bus, robot) as client:
        if clear_fault:
            services.COMMAND.call(client, RunCommand(command="clear_fault"))
        try:
            mission = services.MISSION_SEND.call(client, goal).mission
            if not wait:
                print(f"mission {mission} started")
                return
            begun_s = time.monotonic()
            state = _wait(client, mission)
        except KeyboardInterrupt:
            services.COMMAND.call(client, RunCommand(command="cancel"))
            raise ThumperError(
                "interrupted: goal cancelled; the robot stops", exit_code=EXIT_INTERRUPTED
            ) from None
    if state.state != "reached":
        raise ThumperError(f"goal not reached: {state.reason}")
    print(f"{client.robot} is {state.reason} after {time.monotonic() - begun_s:.1f} s")


def _on_earth(place: tuple[float, float], tolerance_m: float, *, is_alone: bool) -> "SendMission":
    """Return the request to drive to a place on Earth; raise ThumperError if there is another goal, too."""
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.gps.local_plane import LatLon
    from thumper.ros.services import SendMission

    if not is_alone:
        raise ThumperError("--gps is the goal: leave out X, Y and PLACE", exit_code=EXIT_USAGE)
    LatLon(*place).check()
    return SendMission(**LatLon(*place)._asdict(), tolerance_m=tolerance_m)


def _position(x_m: float, y_m: float | None, heading_deg: float | None, tolerance_m: float) -> "SendMission":
    """Return the request to drive to a position; raise ThumperError if a number is wrong."""
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.navigation.goal import check_place
    from thumper.ros.services import SendMission

    if y_m is None:
        raise ThumperError("a goal is X Y or the name of a place: the Y is missing", exit_code=EXIT_USAGE)
    if heading_deg is not None and abs(heading_deg) > FULL_TURN_DEG:
        raise ThumperError(f"HEADING {heading_deg:g}: choose -360 to 360 degrees", exit_code=EXIT_USAGE)
    if not all(map(math.isfinite, (x_m, y_m, heading_deg or 0.0, tolerance_m))):
        raise ThumperError("the goal and --tolerance must be finite numbers", exit_code=EXIT_USAGE)
    check_place("the goal", x_m, y_m)
    yaw_rad = None if heading_deg is None else math.radians(heading_deg)
    return SendMission(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad, tolerance_m=tolerance_m)


def _wait(client: "BusClient", mission: int) -> "MissionStatus":
    """Show the remaining distance until the mission ends; return its final state."""
    from thumper.cli.output.status_line import StatusLine
    from thumper.ros import services
    from thumper.ros.services import FindMission

    begun_s, line = time.monotonic(), StatusLine()
    try:
        while (state := services.MISSION_STATE.call(client, FindMission(mission=mission))).state == "driving":
            reason = f"; {state.reason}" if state.reason else ""
            line.show(f"{state.distance_m:.2f} m to go, {time.monotonic() - begun_s:.1f} s{reason}")
            time.sleep(POLL_PERIOD_S)
    finally:
        line.clear()
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
