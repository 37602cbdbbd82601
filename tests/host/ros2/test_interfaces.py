"""Hashes of services and actions beside those of real ROS 2 systems and of the independent client."""

import json
from pathlib import Path

import pytest
from zenoh_ros2_sdk.utils import compute_service_type_hash

from thumper.ros2 import interfaces
from thumper.ros2.interfaces import ACTIONS, SERVICES, type_hash

# As ROS 2 prints it: design page of rmw_zenoh; a device on a router of ROS 2 Jazzy.
ADD_TWO_INTS = "RIHS01_e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a"
TRIGGER = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"
# From rosidl: files in builds of ROS 2 Jazzy for Python (packages ros-nav-msgs 5.3.6 and others), and what
# it generates from nav2_msgs 1.3.12 and from tf2_msgs of the branch jazzy.
JAZZY = json.loads((Path(__file__).parent / "jazzy_hashes.json").read_text())


def test_hash_of_a_service_is_that_of_ros(monkeypatch: pytest.MonkeyPatch) -> None:
    assert type_hash("std_srvs/srv/Trigger") == TRIGGER
    name = "example_interfaces/srv/AddTwoInts"
    monkeypatch.setattr(interfaces, "SERVICES", {**SERVICES, name: ("int64 a\nint64 b", "int64 sum")})
    caches = (interfaces.ros_typestore, interfaces._hash_store)
    for cached in caches:
        cached.cache_clear()
    assert type_hash(name) == ADD_TWO_INTS
    for cached in caches:
        cached.cache_clear()


@pytest.mark.parametrize("name", JAZZY)
def test_hash_is_that_of_a_build_of_jazzy(name: str) -> None:
    assert type_hash(name) == JAZZY[name]


@pytest.mark.parametrize("name", ["rcl_interfaces/srv/GetParameterTypes", "nav2_msgs/srv/SaveMap"])
def test_hash_of_a_service_is_that_of_the_client(name: str) -> None:
    assert type_hash(name) == compute_service_type_hash(name, *SERVICES[name])


def test_every_part_of_an_action_has_a_hash() -> None:
    parts = ("SendGoal", "GetResult", "FeedbackMessage")
    hashes = {type_hash(f"{action}_{part}") for action in ACTIONS for part in parts}
    assert len(hashes) == len(ACTIONS) * len(parts)
