"""Table of the services: the queries that a robot answers, with the types of request and reply.

On the bus a service is a query at `thumper/<robot>/ask/<name>` whose payload and answer are JSON objects. The
bus checks requests by this table, the robot's request handler dispatches by it, and clients call through it.
docs/reference/bus.md lists it; a test keeps both alike.
"""

import types
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from thumper.ros.service import Service


@dataclass(frozen=True, slots=True, kw_only=True)
class Empty:
    """A request or reply without fields."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterSchema:
    """Reply of `parameters/schema`."""

    parameters: Annotated[
        list[dict[str, Any]], "each with `name`, `unit`, `minimum`, `maximum`, `default`, `step`"
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterValues:
    """Values of board parameters by name."""

    values: dict[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class SendMission:
    """Request of `mission/send`: a goal in `map`, or a saved place."""

    x_m: float | None = None
    y_m: float | None = None
    yaw_rad: Annotated[float | None, "else any heading will do"] = None
    tolerance_m: Annotated[float | None, "0.02 ... 1"] = None
    place: Annotated[str | None, "name of a place, instead of `x_m`, `y_m` and `yaw_rad`"] = None
    object: Annotated[str | None, "class of an object that a detector has seen, likewise"] = None
    latitude_deg: Annotated[float | None, "with `longitude_deg` instead of `x_m` and `y_m`"] = None
    longitude_deg: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionStarted:
    """Reply of `mission/send` and `mission/follow`."""

    mission: Annotated[int, "its number"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FindMission:
    """Request of `mission/state`."""

    mission: Annotated[int | None, "else the newest"] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionStatus:
    """Reply of `mission/state`."""

    mission: int
    state: Annotated[str, "driving, reached, failed"]
    reason: str
    leg: int
    legs: int
    distance_m: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class MappingState:
    """Reply of `mapping/state`."""

    mode: Annotated[str, "mapping, localizing"]
    lost: Annotated[str, "why the pose is lost; empty if it is not"]
    map_doubt: Annotated[str, "why the map is in doubt; empty if it is not"]
    datum: Annotated[str, "the map's place on Earth; empty if it is unknown"]
    gps: Annotated[str, "off, ok, or what it lacks for a position in the map"]


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelsState:
    """Reply of `wheels/state`."""

    text: Annotated[str, "the estimate in one line"]
    drift: Annotated[str, "how the wheels differ from the board's model; empty if they do not"]
    values: Annotated[
        dict[str, float],
        "`left_gain_rad_s_per_pwm`, `mean_time_constant_s`, `right_friction_pwm`..., each with `_std`; only "
        "what is determined",
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class RemoveAnnotation:
    """Request of `annotation/remove`."""

    name: Annotated[str, "of the zone or place"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryContent:
    """Reply of `library/list`."""

    maps: Annotated[list[dict[str, Any]], "each with `name`, `MB` and `saved_s` (Unix time), newest first"]
    recordings: Annotated[list[dict[str, Any]], "likewise"]
    in_use: Annotated[str, "the map in which the robot localizes; empty while it maps"]


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedMap:
    """Request of `library/save` and `library/load`."""

    name: Annotated[str, "of the map"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryItem:
    """Request of `library/delete`."""

    name: Annotated[str, "of the map; of a recording with `.mcap`"]


@dataclass(frozen=True, slots=True, kw_only=True)
class RenameItem:
    """Request of `library/rename`."""

    name: Annotated[str, "of the map; of a recording with `.mcap`"]
    new_name: Annotated[str, "likewise; it must be free"]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunCommand:
    """Request of `command`."""

    command: Annotated[str, "a word as on the topic"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Text:
    """A reply that says what the robot did."""

    text: Annotated[str, "what was done"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatorWorld:
    """Reply of `simulator/world`."""

    faults: Annotated[dict[str, Any], "with their possible values"]
    on: Annotated[dict[str, Any], "the active faults with their values, in order of injection"]
    pillars: Annotated[int, "their number"]
    world: Annotated[str, "its name"]
    worlds: Annotated[list[str], "those to choose from; empty if the robot cannot start again"]
    titles: Annotated[dict[str, str], "of the worlds"]
    speed: Annotated[float, "times real time"]


@dataclass(frozen=True, slots=True, kw_only=True)
class StartExperiment:
    """Request of `experiment/start`."""

    name: str
    lane_m: Annotated[float, "free floor ahead of the robot, and behind it"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentState:
    """Reply of `experiment/state`."""

    running: Annotated[str, "name of the experiment; empty if there is none"]
    share: Annotated[float, "progress, 0 ... 1"]
    what: Annotated[str, "what it does now, or what it has brought"]
    lines: Annotated[list[str], "of the result"]
    problem: Annotated[str, "why it failed; empty if it did not"]
    has_report: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentReport:
    """Reply of `experiment/report`."""

    html: Annotated[str, "a page"]


PARAMETERS_SCHEMA = Service(
    name="parameters/schema",
    summary="lists the parameters of the board",
    request=Empty,
    reply=ParameterSchema,
)
PARAMETERS_GET = Service(
    name="parameters/get",
    summary="reads the values in use",
    request=Empty,
    reply=ParameterValues,
)
PARAMETERS_SET: Service[Mapping[str, Any], ParameterValues] = Service(
    name="parameters/set",
    summary="sets all given values or none; returns them as the board accepted them",
    request=None,
    request_doc="names and values",
    reply=ParameterValues,
)
PARAMETERS_SAVE = Service(
    name="parameters/save",
    summary="stores the values in the board, only while it is stationary",
    request=Empty,
    reply=Empty,
)
PARAMETERS_REVERT = Service(
    name="parameters/revert",
    summary="loads the values stored in the board",
    request=Empty,
    reply=ParameterValues,
)
MISSION_SEND = Service(
    name="mission/send",
    summary="starts to drive to a goal in the map",
    request=SendMission,
    reply=MissionStarted,
)
MISSION_FOLLOW: Service[Mapping[str, Any], MissionStarted] = Service(
    name="mission/follow",
    summary="starts to drive to goals in turn, until one is not reached",
    request=None,
    request_doc='`{"goals": [...], "rounds": 1}`, 1 to 200, each as for `mission/send`; '
    "optional: `wait_s`, `record` and `beep` of a goal, `rounds`",
    reply=MissionStarted,
)
MISSION_STATE = Service(
    name="mission/state",
    summary="returns the progress of a mission",
    request=FindMission,
    reply=MissionStatus,
)
MAPPING_STATE = Service(
    name="mapping/state",
    summary="returns the mode, whether pose and map can be trusted, and the map's place on Earth",
    request=Empty,
    reply=MappingState,
)
WHEELS_STATE = Service(
    name="wheels/state",
    summary="returns the wheels' gain, time constant and friction, estimated while driving",
    request=Empty,
    reply=WheelsState,
)
ANNOTATION_ADD: Service[Mapping[str, Any], Text] = Service(
    name="annotation/add",
    summary="adds a zone or place to the map, or replaces the one of that name",
    request=None,
    request_doc="a GeoJSON [feature](maps.md#zones-and-places)",
    reply=Text,
)
ANNOTATION_REMOVE = Service(
    name="annotation/remove",
    summary="removes a zone or place",
    request=RemoveAnnotation,
    reply=Text,
)
LIBRARY_LIST = Service(
    name="library/list",
    summary="lists the maps and recordings in the robot's [library](../howto/recording.md#library)",
    request=Empty,
    reply=LibraryContent,
)
LIBRARY_SAVE = Service(
    name="library/save",
    summary="saves the map, its session, zones and places under a new name",
    request=NamedMap,
    reply=Text,
)
LIBRARY_LOAD = Service(
    name="library/load",
    summary="localizes in a saved map, with its zones and places",
    request=NamedMap,
    reply=Text,
)
LIBRARY_RENAME = Service(
    name="library/rename",
    summary="renames a map with all its files, or a recording; not the map that is loaded",
    request=RenameItem,
    reply=Text,
)
LIBRARY_DELETE = Service(
    name="library/delete",
    summary="deletes a map with all its files, or a recording; not the map that is loaded",
    request=LibraryItem,
    reply=Text,
)
COMMAND = Service(
    name="command",
    summary="carries out a command",
    request=RunCommand,
    reply=Text,
)
SIMULATOR_WORLD = Service(
    name="simulator/world",
    summary="describes the simulated world",
    request=Empty,
    reply=SimulatorWorld,
)
SIMULATOR_COMMAND: Service[Mapping[str, Any], Text] = Service(
    name="simulator/command",
    summary="changes the simulated world",
    request=None,
    request_doc='`{"fault": NAME, "value": V}`, `{"pillar": {"x_m", "y_m", "radius_m"}}`, '
    '`{"clear_pillars": true}`, `{"clear_faults": true}`, `{"speed": 2}`, '
    '`{"world": NAME}`: starts again there, motors off',
    reply=Text,
)
EXPERIMENT_START = Service(
    name="experiment/start",
    summary="starts one of the dashboard's [experiments](../howto/dashboard.md#tune)",
    request=StartExperiment,
    reply=Text,
)
EXPERIMENT_STATE = Service(
    name="experiment/state",
    summary="returns the progress of the experiment",
    request=Empty,
    reply=ExperimentState,
)
EXPERIMENT_REPORT = Service(
    name="experiment/report",
    summary="returns the newest report",
    request=Empty,
    reply=ExperimentReport,
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
            MISSION_FOLLOW,
            MISSION_STATE,
            MAPPING_STATE,
            WHEELS_STATE,
            ANNOTATION_ADD,
            ANNOTATION_REMOVE,
            LIBRARY_LIST,
            LIBRARY_SAVE,
            LIBRARY_LOAD,
            LIBRARY_RENAME,
            LIBRARY_DELETE,
            COMMAND,
            SIMULATOR_WORLD,
            SIMULATOR_COMMAND,
            EXPERIMENT_START,
            EXPERIMENT_STATE,
            EXPERIMENT_REPORT,
        )
    }
)
