"""Table of the services: the queries that a robot answers, with the types of request and reply.

On the bus a service is a query at `thumper/<robot>/ask/<name>` whose payload and answer are JSON objects. The
bus checks requests by this table, the robot's request handler dispatches by it, and clients call through it.
docs/operate.md lists it; a test keeps both alike.
"""

import types
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any, Generic, Protocol, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from thumper.common.errors import ThumperError

RequestT = TypeVar("RequestT")
ReplyT = TypeVar("ReplyT")

_TYPE_NAMES = {float: "a number", int: "an integer", str: "a string"}


class QueryClient(Protocol):
    """The part of a bus client that services need."""

    def query(self, name: str, payload: Mapping[str, Any], *, source: str = "") -> Mapping[str, Any]:
        """Query the robot and return its answer; raises ThumperError if it refuses or does not answer."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Empty:
    """A request or reply without fields."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterSchema:
    """Reply of `parameters/schema`."""

    parameters: list[dict[str, Any]]  # each with name, unit, minimum, maximum, default, step


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterValues:
    """Values of board parameters by name."""

    values: dict[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class SendMission:
    """Request of `mission/send`: a goal in `map`. Without `yaw_rad` any heading will do."""

    x_m: float
    y_m: float
    yaw_rad: float | None = None
    tolerance_m: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionStarted:
    """Reply of `mission/send`."""

    mission: int  # its number


@dataclass(frozen=True, slots=True, kw_only=True)
class FindMission:
    """Request of `mission/state`; without a number, the newest mission."""

    mission: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionStatus:
    """Reply of `mission/state`."""

    mission: int
    state: str  # driving, reached, failed
    reason: str
    leg: int
    legs: int
    distance_m: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class MappingState:
    """Reply of `mapping/state`."""

    mode: str  # mapping, localising
    lost: str  # why the pose is lost; empty: it is not
    map_doubt: str  # why the map is in doubt; empty: it is not


@dataclass(frozen=True, slots=True, kw_only=True)
class RunCommand:
    """Request of `command`: one of `runtime.requests.COMMANDS`."""

    command: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Text:
    """A reply that says what the robot did."""

    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatorWorld:
    """Reply of `simulator/world`."""

    faults: dict[str, Any]  # the possible values of each
    on: dict[str, Any]  # active faults with their values, in order of injection
    pillars: int


@dataclass(frozen=True, slots=True, kw_only=True)
class StartExperiment:
    """Request of `experiment/start`."""

    name: str
    lane_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentState:
    """Reply of `experiment/state`."""

    running: str  # name of the experiment; empty: none
    share: float  # progress, 0...1
    what: str  # what it does now
    lines: list[str]  # of the result
    problem: str  # why it failed; empty: it did not
    has_report: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentReport:
    """Reply of `experiment/report`."""

    html: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Service(Generic[RequestT, ReplyT]):
    """One query: its name, its types, and the cells of its row in docs/operate.md."""

    name: str
    request: type[RequestT] | None  # None: the JSON object has other keys than fields, see `request_doc`
    reply: type[ReplyT]
    request_doc: str = ""
    reply_doc: str

    def check(self, content: Mapping[str, Any]) -> None:
        """Check the JSON object of a request; raises ValueError for a wrong field."""
        if self.request is not None:
            _check_fields(self.request, content)

    def call(self, client: QueryClient, request: RequestT | None = None, *, source: str = "") -> ReplyT:
        """Call the service; raises ThumperError if the robot refuses or does not answer."""
        return self.read_reply(client.query(self.name, _content(request), source=source))

    def read_reply(self, answer: Mapping[str, Any]) -> ReplyT:
        """Convert the JSON object of an answer; raises ThumperError if a field is missing."""
        names = [field.name for field in fields(self.reply)]  # type: ignore[arg-type]  # all are dataclasses
        if missing := [name for name in names if name not in answer]:
            raise ThumperError(
                f"the robot's answer to {self.name} has no {missing[0]!r}; is it another version?"
            )
        return self.reply(**{name: answer[name] for name in names})


PARAMETERS_SCHEMA = Service(
    name="parameters/schema",
    request=Empty,
    reply=ParameterSchema,
    reply_doc="`parameters`: name, unit, range, default and step of each board parameter",
)
PARAMETERS_GET = Service(
    name="parameters/get", request=Empty, reply=ParameterValues, reply_doc="`values` in use"
)
PARAMETERS_SET: Service[Mapping[str, Any], ParameterValues] = Service(
    name="parameters/set",
    request=None,
    reply=ParameterValues,
    request_doc="names and values; sets all of them or none",
    reply_doc="`values` as the board accepted them",
)
PARAMETERS_SAVE = Service(
    name="parameters/save",
    request=Empty,
    reply=Empty,
    reply_doc="stores the values in the board (only while it is stationary)",
)
PARAMETERS_REVERT = Service(
    name="parameters/revert",
    request=Empty,
    reply=ParameterValues,
    reply_doc="`values` stored in the board",
)
MISSION_SEND = Service(
    name="mission/send",
    request=SendMission,
    reply=MissionStarted,
    request_doc="`x_m`, `y_m`, optionally `yaw_rad`, `tolerance_m`",
    reply_doc="`mission`, its number",
)
MISSION_STATE = Service(
    name="mission/state",
    request=FindMission,
    reply=MissionStatus,
    request_doc="`mission`, or nothing for the newest",
    reply_doc="`mission`, `state` (driving, reached, failed), `reason`, `leg`, `legs`, `distance_m`",
)
MAPPING_STATE = Service(
    name="mapping/state",
    request=Empty,
    reply=MappingState,
    reply_doc="`mode` (mapping, localising); why the robot is `lost`, or its map is in doubt (`map_doubt`)",
)
COMMAND = Service(
    name="command",
    request=RunCommand,
    reply=Text,
    request_doc="`command`: a word as on the topic",
    reply_doc="`text`: what the robot did",
)
SIMULATOR_WORLD = Service(
    name="simulator/world",
    request=Empty,
    reply=SimulatorWorld,
    reply_doc="`faults` with their values, the active ones (`on`) in order of injection, number of `pillars`",
)
SIMULATOR_COMMAND: Service[Mapping[str, Any], Text] = Service(
    name="simulator/command",
    request=None,
    reply=Text,
    request_doc='`{"fault": NAME, "value": V}`, `{"pillar": {"x_m", "y_m", "radius_m"}}`, '
    '`{"clear_pillars": true}`, `{"speed": 2}`',
    reply_doc="`text`: what the simulator did",
)
EXPERIMENT_START = Service(
    name="experiment/start",
    request=StartExperiment,
    reply=Text,
    request_doc="`name`, `lane_m`; see the page's [experiments](dashboard.md#parts-of-the-page)",
    reply_doc="`text`: what the robot does",
)
EXPERIMENT_STATE = Service(
    name="experiment/state",
    request=Empty,
    reply=ExperimentState,
    reply_doc="`running`, `share` done, `what` it does, result `lines`, `problem`, `has_report`",
)
EXPERIMENT_REPORT = Service(
    name="experiment/report", request=Empty, reply=ExperimentReport, reply_doc="`html`: the newest report"
)

SERVICES: Mapping[str, Service[Any, Any]] = types.MappingProxyType(
    {
        service.name: service
        for service in (
            PARAMETERS_SCHEMA,
            PARAMETERS_GET,
            PARAMETERS_SET,
            PARAMETERS_SAVE,
            PARAMETERS_REVERT,
            MISSION_SEND,
            MISSION_STATE,
            MAPPING_STATE,
            COMMAND,
            SIMULATOR_WORLD,
            SIMULATOR_COMMAND,
            EXPERIMENT_START,
            EXPERIMENT_STATE,
            EXPERIMENT_REPORT,
        )
    }
)


def _content(request: object) -> Mapping[str, Any]:
    """Return the JSON object of a request; optional fields that are None are left out."""
    if request is None or isinstance(request, Mapping):
        return request or {}
    values = {field.name: getattr(request, field.name) for field in fields(request)}  # type: ignore[arg-type]
    return {name: value for name, value in values.items() if value is not None}


def _check_fields(request: type[Any], content: Mapping[str, Any]) -> None:
    hints = get_type_hints(request)
    for name, value in content.items():
        if name not in hints:
            raise ValueError(f"unknown field {name!r}; its fields: {', '.join(hints) or 'none'}")
        expected = _json_type(hints[name])
        accepted = (int, float) if expected is float else (expected,)
        if not isinstance(value, accepted) or (isinstance(value, bool) and expected is not bool):
            raise ValueError(f"{name}: expected {_TYPE_NAMES[expected]}, not {value!r}")
    for field in fields(request):
        if field.default is MISSING and field.name not in content:
            raise ValueError(f"missing field {field.name!r}")


def _json_type(hint: Any) -> type:
    """Return the JSON type of a field; an optional field is absent or of its type, never null."""
    if get_origin(hint) in (Union, types.UnionType):
        (hint,) = (part for part in get_args(hint) if part is not type(None))
    return cast("type", hint)
