"""Keys, tokens and attachments as the design page of rmw_zenoh shows them."""

import pytest

from thumper.ros.codec import typestore
from thumper.ros2.wire import PUBLISHER, SUBSCRIPTION, Attachment, NodeName, Qos, node_name

STRING = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
SESSION = "aac3178e146ba6f1fc6e6a4085e77f21"


def test_key_of_a_topic() -> None:
    type_hash = typestore().hash_rihs01("std_msgs/msg/String")
    key = NodeName(domain_id=0, name="talker").data_key("/robot1/chatter", "std_msgs/msg/String", type_hash)
    assert key == f"0/robot1/chatter/std_msgs::msg::dds_::String_/{STRING}"


def test_tokens_of_a_node_and_its_subscription() -> None:
    node = NodeName(domain_id=2, name="listener")
    assert node.node_token(SESSION) == f"@ros2_lv/2/{SESSION}/0/0/NN/%/%/listener"
    endpoint = ("/chatter", "std_msgs/msg/String", STRING)
    token = node.endpoint_token(SESSION, 10, SUBSCRIPTION, endpoint, Qos(depth=7))
    start = f"@ros2_lv/2/{SESSION}/0/10/MS/%/%/listener/%chatter/std_msgs::msg::dds_::String_/{STRING}/"
    assert token == start + "1:2:1,7:,:,:,,"  # the page leaves the defaults out: ::,7:,:,:,,


def test_token_in_a_namespace() -> None:
    node = NodeName(domain_id=0, name="r1", namespace="/fleet")
    token = node.endpoint_token(SESSION, 1, PUBLISHER, (node.qualified("scan"), "a/msg/B", "H"), Qos())
    assert "/MP/%/%fleet/r1/%fleet%scan/a::msg::dds_::B_/H/" in token
    assert node.qualified("~/arm") == "/fleet/r1/arm"
    assert node.qualified("/clock") == "/clock"


def test_attachment() -> None:
    attachment = Attachment(sequence=1, source_time_ns=2, gid=bytes(range(16)))
    raw = attachment.encode()
    assert raw == b"\1" + bytes(7) + b"\2" + bytes(7) + b"\x10" + bytes(range(16))
    assert Attachment.decode(raw) == attachment
    with pytest.raises(ValueError, match="not an attachment"):
        Attachment.decode(raw[:-1])


def test_node_name_is_one_that_ros_allows() -> None:
    assert [node_name(robot) for robot in ("lab-1", "4wd", "a_-_b")] == ["lab_1", "robot_4wd", "a_b"]
