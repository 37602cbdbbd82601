"""Services and actions of ROS 2 Jazzy that the robot offers: their messages, and the hashes of all types.

`rosbags` has only messages. A service is three structures (request, response, event) in one; an action is two
services and two topics (design.ros2.org/articles/actions.html). The definitions are those of std_srvs,
nav_msgs, rcl_interfaces and action_msgs, and of the branch jazzy of nav2_msgs.
"""

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from thumper.ros.codec import typestore

TRIGGER = "std_srvs/srv/Trigger"
GET_MAP = "nav_msgs/srv/GetMap"
SAVE_MAP = "nav2_msgs/srv/SaveMap"
CLEAR_COSTMAP = "nav2_msgs/srv/ClearEntireCostmap"
CANCEL_GOAL = "action_msgs/srv/CancelGoal"
NAVIGATE_TO_POSE = "nav2_msgs/action/NavigateToPose"
FOLLOW_WAYPOINTS = "nav2_msgs/action/FollowWaypoints"
COMPUTE_PATH_TO_POSE = "nav2_msgs/action/ComputePathToPose"

MISSED_WAYPOINT = "nav2_msgs/msg/MissedWaypoint"
MESSAGES = {MISSED_WAYPOINT: "uint32 index\ngeometry_msgs/PoseStamped goal\nuint16 error_code"}

SERVICES: Mapping[str, tuple[str, str]] = {  # request, response
    TRIGGER: ("", "bool success\nstring message"),
    GET_MAP: ("", "nav_msgs/OccupancyGrid map"),
    SAVE_MAP: (
        "string map_topic\nstring map_url\nstring image_format\nstring map_mode\nfloat32 free_thresh\n"
        "float32 occupied_thresh",
        "bool result",
    ),
    CLEAR_COSTMAP: ("std_msgs/Empty request", "std_msgs/Empty response"),
    CANCEL_GOAL: (
        "action_msgs/GoalInfo goal_info",
        "int8 return_code\naction_msgs/GoalInfo[] goals_canceling",
    ),
    "rcl_interfaces/srv/ListParameters": (
        "string[] prefixes\nuint64 depth",
        "rcl_interfaces/ListParametersResult result",
    ),
    "rcl_interfaces/srv/DescribeParameters": (
        "string[] names",
        "rcl_interfaces/ParameterDescriptor[] descriptors",
    ),
    "rcl_interfaces/srv/GetParameters": ("string[] names", "rcl_interfaces/ParameterValue[] values"),
    "rcl_interfaces/srv/GetParameterTypes": ("string[] names", "uint8[] types"),
    "rcl_interfaces/srv/SetParameters": (
        "rcl_interfaces/Parameter[] parameters",
        "rcl_interfaces/SetParametersResult[] results",
    ),
    "rcl_interfaces/srv/SetParametersAtomically": (
        "rcl_interfaces/Parameter[] parameters",
        "rcl_interfaces/SetParametersResult result",
    ),
}
ACTIONS: Mapping[str, tuple[str, str, str]] = {  # goal, result, feedback
    NAVIGATE_TO_POSE: (
        "geometry_msgs/PoseStamped pose\nstring behavior_tree",
        "uint16 error_code\nstring error_msg",
        "geometry_msgs/PoseStamped current_pose\nbuiltin_interfaces/Duration navigation_time\n"
        "builtin_interfaces/Duration estimated_time_remaining\nint16 number_of_recoveries\n"
        "float32 distance_remaining",
    ),
    FOLLOW_WAYPOINTS: (
        "uint32 number_of_loops\nuint32 goal_index 0\ngeometry_msgs/PoseStamped[] poses",
        "nav2_msgs/MissedWaypoint[] missed_waypoints\nuint16 error_code\nstring error_msg",
        "uint32 current_waypoint",
    ),
    COMPUTE_PATH_TO_POSE: (
        "geometry_msgs/PoseStamped goal\ngeometry_msgs/PoseStamped start\nstring planner_id\nbool use_start",
        "nav_msgs/Path path\nbuiltin_interfaces/Duration planning_time\nuint16 error_code\nstring error_msg",
        "",
    ),
}

Fields = list[tuple[str, Any]]  # name and rosbags' description of the type
EMPTY: Fields = [("structure_needs_at_least_one_member", (Nodetype.BASE, ("uint8", 0)))]  # as rosidl does
UUID, TIME = "unique_identifier_msgs/msg/UUID", "builtin_interfaces/msg/Time"
EVENT_INFO = "service_msgs/msg/ServiceEventInfo"


def type_hash(type_name: str) -> str:
    """Return the RIHS01 hash of a message, service, or part of an action."""
    return _hash_store().hash_rihs01(type_name)


@cache
def ros_typestore() -> Typestore:
    """Return the store of `thumper.ros.codec`, which from now on encodes these services and actions, too."""
    store = typestore()
    store.register({name: ([], fields) for name, fields in _messages()})
    return store


@cache
def _hash_store() -> Typestore:
    """Return a store that has services as types, too."""
    store = get_typestore(Stores.ROS2_JAZZY)
    services: Any = {name: ([], fields) for name, fields in _services()}
    store.fielddefs = {**ros_typestore().fielddefs, **services}
    # rosidl makes `char[16] client_gid` uint8; rosbags' definition keeps char, which has another hash.
    constants, fields = store.fielddefs[EVENT_INFO]
    gid: Any = (Nodetype.ARRAY, ((Nodetype.BASE, ("uint8", 0)), 16))
    store.fielddefs[EVENT_INFO] = (
        constants,
        [(name, gid if name == "client_gid" else kind) for name, kind in fields],
    )
    return store


def _messages() -> Iterator[tuple[str, Fields]]:
    """Yield what travels: requests, responses, goals, results, feedback."""
    for name, text in MESSAGES.items():
        yield name, _parsed(text)
    for name, (request, response) in SERVICES.items():
        yield f"{name}_Request", _parsed(request)
        yield f"{name}_Response", _parsed(response)
    for name, (goal, result, feedback) in ACTIONS.items():
        yield f"{name}_Goal", _parsed(goal)
        yield f"{name}_Result", _parsed(result)
        yield f"{name}_Feedback", _parsed(feedback)
        goal_id = ("goal_id", _of(UUID))
        yield f"{name}_SendGoal_Request", [goal_id, ("goal", _of(f"{name}_Goal"))]
        yield (
            f"{name}_SendGoal_Response",
            [("accepted", (Nodetype.BASE, ("bool", 0))), ("stamp", _of(TIME))],
        )
        yield f"{name}_GetResult_Request", [goal_id]
        yield (
            f"{name}_GetResult_Response",
            [("status", (Nodetype.BASE, ("int8", 0))), ("result", _of(f"{name}_Result"))],
        )
        yield f"{name}_FeedbackMessage", [goal_id, ("feedback", _of(f"{name}_Feedback"))]


def _services() -> Iterator[tuple[str, Fields]]:
    """Yield the structures that only hashes see."""
    parts = [f"{action}_{part}" for action in ACTIONS for part in ("SendGoal", "GetResult")]
    for name in (*SERVICES, *parts):
        request, response, event = (f"{name}_{part}" for part in ("Request", "Response", "Event"))
        optional: Fields = [
            ("request", (Nodetype.SEQUENCE, (_of(request), 1))),
            ("response", (Nodetype.SEQUENCE, (_of(response), 1))),
        ]
        yield event, [("info", _of(EVENT_INFO)), *optional]
        members = (("request_message", request), ("response_message", response), ("event_message", event))
        yield name, [(member, _of(kind)) for member, kind in members]


def _parsed(text: str) -> Fields:
    if not text:
        return EMPTY
    parsed = get_types_from_msg(text, "thumper_msgs/msg/Parsed")
    ((_, fields),) = parsed.values()
    return list(fields)


def _of(type_name: str) -> Any:
    return (Nodetype.NAME, type_name)
