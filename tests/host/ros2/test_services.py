"""The node's services, called by an independent ROS client on a simulated robot."""

from typing import Any

import numpy as np
import pytest
from benchmarks.shared.live import until
from zenoh_ros2_sdk import ROS2ServiceClient, get_registry, get_service_names_and_types

from tests.host.ros2.conftest import Live

NOTHING = "uint8 structure_needs_at_least_one_member"  # what rosidl makes of an empty request
PARAMETERS = "rcl_interfaces/Parameter[] parameters"


def call(name: str, type_name: str, sent: str, received: str, *needs: str, **content: Any) -> Any:
    for message in needs:
        assert get_registry().load_message_type(message)
    client = ROS2ServiceClient(f"/live/{name}", type_name, sent, received, domain_id=9, timeout=20.0)
    answer = client.call(**content)
    client.close()
    assert answer is not None, "no answer"
    return answer


def trigger(name: str) -> Any:
    nothing = {"structure_needs_at_least_one_member": 0}
    response = "bool success\nstring message"
    return call(f"thumper/{name}", "std_srvs/srv/Trigger", NOTHING, response, **nothing)


def test_graph_lists_the_services(live: Live) -> None:
    listed = dict(until(lambda: get_service_names_and_types(domain_id=9), 20.0))
    assert listed["/live/thumper/arm"] == ["std_srvs/srv/Trigger"]
    assert listed["/live/thumper/set_parameters"] == ["rcl_interfaces/srv/SetParameters"]
    assert listed["/live/map_server/map"] == ["nav_msgs/srv/GetMap"]
    clear = "/live/local_costmap/clear_entirely_local_costmap"
    assert listed[clear] == ["nav2_msgs/srv/ClearEntireCostmap"]
    action = "/live/navigate_to_pose/_action"
    assert listed[f"{action}/send_goal"] == ["nav2_msgs/action/NavigateToPose_SendGoal"]
    assert listed[f"{action}/cancel_goal"] == ["action_msgs/srv/CancelGoal"]


def test_arm_emergency_stop_and_clear(live: Live) -> None:
    until(lambda: trigger("arm").success, 30.0)
    until(lambda: live.status.board_state == "CLOSED_LOOP", 20.0)
    assert trigger("emergency_stop").success
    until(lambda: live.status.fault_words == "emergency stop", 20.0)
    refusal = trigger("arm")
    assert not refusal.success
    assert "fault" in refusal.message
    assert trigger("clear_fault").success
    until(lambda: live.status.board_state == "DISARMED", 20.0)


def test_map(live: Live) -> None:
    content = {"structure_needs_at_least_one_member": 0}
    grid = "nav_msgs/msg/OccupancyGrid"
    answer = call(
        "map_server/map", "nav_msgs/srv/GetMap", NOTHING, "nav_msgs/OccupancyGrid map", grid, **content
    )
    assert answer.map.header.frame_id == "map"
    assert (np.asarray(answer.map.data) == 100).sum() > 20  # walls


def test_board_parameters_are_those_of_the_node(live: Live) -> None:
    kinds = ("rcl_interfaces/msg/ListParametersResult", "rcl_interfaces/msg/ParameterValue")
    listing = call(
        "thumper/list_parameters",
        "rcl_interfaces/srv/ListParameters",
        "string[] prefixes\nuint64 depth",
        "rcl_interfaces/ListParametersResult result",
        kinds[0],
        prefixes=[],
        depth=0,
    )
    assert {"kp", "use_sim_time"} <= set(listing.result.names)

    def get(*names: str) -> list[Any]:
        answer = call(
            "thumper/get_parameters",
            "rcl_interfaces/srv/GetParameters",
            "string[] names",
            "rcl_interfaces/ParameterValue[] values",
            kinds[1],
            names=list(names),
        )
        return list(answer.values)

    kp, simulated, unknown = get("kp", "use_sim_time", "nonsense")
    assert (kp.type, simulated.type, simulated.bool_value, unknown.type) == (3, 1, True, 0)

    def put(value: float) -> Any:
        types = get_registry().session.store.types
        assert get_registry().load_message_type("rcl_interfaces/msg/Parameter")
        content = {**vars(kp), "type": 3, "double_value": value}
        content.pop("__msgtype__", None)
        wanted = types["rcl_interfaces/msg/ParameterValue"](**content)
        parameter = types["rcl_interfaces/msg/Parameter"](name="kp", value=wanted)
        answer = call(
            "thumper/set_parameters",
            "rcl_interfaces/srv/SetParameters",
            PARAMETERS,
            "rcl_interfaces/SetParametersResult[] results",
            "rcl_interfaces/msg/SetParametersResult",
            parameters=[parameter],
        )
        return answer.results[0]

    assert put(kp.double_value + 1.0).successful
    assert get("kp")[0].double_value == pytest.approx(kp.double_value + 1.0, abs=0.01)
    refused = put(1e9)
    assert (refused.successful, "is refused" in refused.reason) == (False, True)
    assert put(kp.double_value).successful


def test_costmaps_are_cleared_and_the_map_is_saved(live: Live) -> None:
    empty = "std_msgs/msg/Empty"
    assert get_registry().load_message_type(empty)
    nothing = get_registry().session.store.types[empty](structure_needs_at_least_one_member=0)
    call(
        "global_costmap/clear_entirely_global_costmap",
        "nav2_msgs/srv/ClearEntireCostmap",
        "std_msgs/Empty request",
        "std_msgs/Empty response",
        request=nothing,
    )
    until(lambda: trigger("save_map").success, 30.0)
    until((live.folder / "map.yaml").exists, 30.0)
