"""The messages that a page may send. All others are refused."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, TypeAdapter, ValidationError

from thumper.common.texts import shortened
from thumper.maps.library import RECORDING
from thumper.navigation.goal import FARTHEST_M
from thumper.runtime.requests import MAX_WAIT_S

MAX_MESSAGE_BYTES = 8192
MAX_WAYPOINTS = 50
MAX_ROUNDS = 1000

Metres = Annotated[FiniteFloat, Field(ge=-FARTHEST_M, le=FARTHEST_M)]
Heading = Annotated[FiniteFloat, Field(ge=-6.2832, le=6.2832)]
Name = Annotated[str, Field(min_length=1, max_length=40)]
FileName = Annotated[str, Field(min_length=1, max_length=40 + len(RECORDING))]
Share = Annotated[FiniteFloat, Field(ge=-1.0, le=1.0)]


class _PageMessage(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class PageHeartbeat(_PageMessage):
    """The page is open and visible."""

    kind: Literal["heartbeat"]
    n: Annotated[int, Field(ge=0, lt=2**53)]


class EStop(_PageMessage):
    """Emergency stop: motors off, latched."""

    kind: Literal["estop"]


class GoalMessage(_PageMessage):
    """Drive to this goal; None allows any heading."""

    kind: Literal["goal"]
    x_m: Metres
    y_m: Metres
    yaw_rad: Heading | None


class InitialPose(_PageMessage):
    """Set the robot's pose."""

    kind: Literal["initial_pose"]
    x_m: Metres
    y_m: Metres
    yaw_rad: Heading


class PageWaypoint(_PageMessage):
    """A goal, and what the robot does there; None allows any heading."""

    x_m: Metres
    y_m: Metres
    yaw_rad: Heading | None
    wait_s: Annotated[FiniteFloat, Field(ge=0.0, le=MAX_WAIT_S)]
    record: bool
    beep: bool


class WaypointsMessage(_PageMessage):
    """Drive to these waypoints, one after another."""

    kind: Literal["waypoints"]
    goals: Annotated[list[PageWaypoint], Field(min_length=1, max_length=MAX_WAYPOINTS)]


class Teleop(_PageMessage):
    """Manual driving: shares of the maximum speed."""

    kind: Literal["teleop"]
    forward: Share
    left: Share
    turbo: bool
    override: bool = False  # drive although something is in the way


class CommandMessage(_PageMessage):
    """Run a command of the robot."""

    kind: Literal["command"]
    name: Literal[
        "cancel",
        "clear_fault",
        "arm",
        "disarm",
        "record_start",
        "record_stop",
        "save_map",
        "explore",
        "relocalize",
        "map_on",
    ]


class Obstacle(_PageMessage):
    """Put a pillar into the simulated world."""

    kind: Literal["obstacle"]
    x_m: Metres
    y_m: Metres
    radius_m: Annotated[FiniteFloat, Field(ge=0.02, le=2.0)]


class AddToMap(_PageMessage):
    """Add a zone or place to the map, or replace the one of that name."""

    kind: Literal["add_annotation"]
    feature: dict[str, Any]  # GeoJSON, checked by `parse_feature`


class RemoveFromMap(_PageMessage):
    """Remove a zone or place from the map."""

    kind: Literal["remove_annotation"]
    name: Name


class SaveMapAs(_PageMessage):
    """Save the map under a name in the robot's library."""

    kind: Literal["save_as"]
    name: Name


class LoadMap(_PageMessage):
    """Localize in a map of the robot's library."""

    kind: Literal["load_map"]
    name: Name


class RenameInLibrary(_PageMessage):
    """Rename a map or recording of the robot's library."""

    kind: Literal["rename"]
    name: FileName
    new_name: FileName


class DeleteFromLibrary(_PageMessage):
    """Delete a map or recording of the robot's library."""

    kind: Literal["delete"]
    name: FileName


class PlaceGoal(_PageMessage):
    """Drive to a place."""

    kind: Literal["place_goal"]
    name: Name


class Patrol(_PageMessage):
    """Drive to places in turn, some rounds."""

    kind: Literal["patrol"]
    places: Annotated[list[Name], Field(min_length=1, max_length=MAX_WAYPOINTS)]
    rounds: Annotated[int, Field(ge=1, le=MAX_ROUNDS)]


class TakeControl(_PageMessage):
    """Take control of the robot from the page that has it."""

    kind: Literal["take_control"]


class ExperimentMessage(_PageMessage):
    """Start an experiment."""

    kind: Literal["experiment"]
    name: Annotated[str, Field(min_length=1, max_length=40, pattern=r"^[a-z_]+$")]
    lane_m: Annotated[FiniteFloat, Field(ge=0.6, le=10.0)]


PageMessage = (
    PageHeartbeat
    | EStop
    | GoalMessage
    | InitialPose
    | WaypointsMessage
    | Teleop
    | CommandMessage
    | Obstacle
    | AddToMap
    | RemoveFromMap
    | SaveMapAs
    | LoadMap
    | RenameInLibrary
    | DeleteFromLibrary
    | PlaceGoal
    | Patrol
    | ExperimentMessage
    | TakeControl
)

_ADAPTER: TypeAdapter[PageMessage] = TypeAdapter(Annotated[PageMessage, Field(discriminator="kind")])


class PageMessageError(ValueError):
    """The text is not a valid message; the error gives the reason in one line."""


def parse_message(text: str) -> PageMessage:
    """Parse and check one message.

    Raises
    ------
    PageMessageError
        It is too long, not JSON, of an unknown kind, or has an unknown field or a value out of range.
    """
    if len(text) > MAX_MESSAGE_BYTES:
        raise PageMessageError("refused: the message is too long")
    try:
        return _ADAPTER.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        field = ".".join(str(part) for part in first["loc"])
        raise PageMessageError(shortened(f"refused {field or 'the message'}: {first['msg']}")) from None
