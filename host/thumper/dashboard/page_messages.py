"""What a page may ask for. Whatever else comes from a browser is refused before anything looks at it."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, TypeAdapter, ValidationError

from thumper.navigation.goal import FARTHEST_M

LARGEST_ORDER_BYTES = 8192
MOST_WAYPOINTS = 50

Metres = Annotated[FiniteFloat, Field(ge=-FARTHEST_M, le=FARTHEST_M)]
Heading = Annotated[FiniteFloat, Field(ge=-6.2832, le=6.2832)]
Place = Annotated[list[Metres], Field(min_length=2, max_length=2)]  # x, y
Share = Annotated[FiniteFloat, Field(ge=-1.0, le=1.0)]


class _PageMessage(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class PageHeartbeat(_PageMessage):
    """The page is there, and somebody can see it."""

    kind: Literal["heartbeat"]
    n: Annotated[int, Field(ge=0, lt=2**53)]


class EStop(_PageMessage):
    """Motors off, latched."""

    kind: Literal["estop"]


class GoalMessage(_PageMessage):
    """Drive there; without a heading, whichever comes."""

    kind: Literal["goal"]
    x_m: Metres
    y_m: Metres
    yaw_rad: Heading | None


class InitialPose(_PageMessage):
    """The robot stands there."""

    kind: Literal["initial_pose"]
    x_m: Metres
    y_m: Metres
    yaw_rad: Heading


class Waypoints(_PageMessage):
    """Drive to these, one after the other."""

    kind: Literal["waypoints"]
    places: Annotated[list[Place], Field(min_length=1, max_length=MOST_WAYPOINTS)]


class Teleop(_PageMessage):
    """Drive by hand: shares of the fastest speed."""

    kind: Literal["teleop"]
    forward: Share
    left: Share
    turbo: bool


class CommandMessage(_PageMessage):
    """One of the robot's commands."""

    kind: Literal["command"]
    name: Literal["cancel", "clear_fault", "arm", "disarm", "record_start", "record_stop", "save_map"]


class Obstacle(_PageMessage):
    """A pillar in the simulated world."""

    kind: Literal["obstacle"]
    x_m: Metres
    y_m: Metres
    radius_m: Annotated[FiniteFloat, Field(ge=0.02, le=2.0)]


class ExperimentMessage(_PageMessage):
    """Have the robot drive an experiment by itself."""

    kind: Literal["experiment"]
    name: Annotated[str, Field(min_length=1, max_length=40, pattern=r"^[a-z_]+$")]
    lane_m: Annotated[FiniteFloat, Field(ge=0.6, le=10.0)]


PageMessage = (
    PageHeartbeat
    | EStop
    | GoalMessage
    | InitialPose
    | Waypoints
    | Teleop
    | CommandMessage
    | Obstacle
    | ExperimentMessage
)

_ADAPTER: TypeAdapter[PageMessage] = TypeAdapter(Annotated[PageMessage, Field(discriminator="kind")])


class PageMessageError(ValueError):
    """Not an order; the message says why in one line."""


def read_order(text: str) -> PageMessage:
    """Read one order.

    Raises
    ------
    OrderError
        It is too long, no JSON, of an unknown kind, has a field too many, or a value out of range.
    """
    if len(text) > LARGEST_ORDER_BYTES:
        raise PageMessageError("refused: longer than any order")
    try:
        return _ADAPTER.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        raise PageMessageError(f"refused {place or 'the order'}: {first['msg']}") from None
