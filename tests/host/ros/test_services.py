"""Services: requests are checked field by field, replies become their types."""

from collections.abc import Mapping
from typing import Any

import pytest

from thumper.common.errors import ThumperError
from thumper.ros import services
from thumper.ros.services import FindMission, SendMission


class Client:
    """Records the query and returns a fixed answer."""

    def __init__(self, answer: Mapping[str, Any]) -> None:
        self._answer = answer
        self.sent: tuple[str, dict[str, Any], str] | None = None

    def query(self, name: str, payload: Mapping[str, Any], *, source: str = "") -> Mapping[str, Any]:
        self.sent = (name, dict(payload), source)
        return self._answer


def test_call_sends_the_json_of_the_request_and_reads_the_reply() -> None:
    client = Client({"ok": True, "mission": 3})
    reply = services.MISSION_SEND.call(client, SendMission(x_m=1.0, y_m=2.0), source="page")
    assert client.sent == ("mission/send", {"x_m": 1.0, "y_m": 2.0}, "page")
    assert reply.mission == 3


def test_call_without_content() -> None:
    client = Client({"ok": True, "values": {"kp": 1.0}})
    assert services.PARAMETERS_GET.call(client).values == {"kp": 1.0}
    assert client.sent == ("parameters/get", {}, "")


def test_names_and_values_are_sent_as_they_are() -> None:
    client = Client({"ok": True, "values": {"kp": 1.0}})
    services.PARAMETERS_SET.call(client, {"kp": 1.0})
    assert client.sent == ("parameters/set", {"kp": 1.0}, "")


def test_reply_of_another_version_is_refused() -> None:
    with pytest.raises(ThumperError, match="answer to mission/state has no 'state'"):
        services.MISSION_STATE.call(Client({"ok": True, "mission": 1}), FindMission())


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("mission/send", {"x_m": 1, "y_m": -2.5}),
        ("mission/send", {"x_m": 1.0, "y_m": 0.0, "yaw_rad": 3, "tolerance_m": 0.1}),
        ("mission/state", {}),
        ("mission/state", {"mission": 4}),
        ("command", {"command": "arm"}),
        ("parameters/get", {}),
        ("parameters/set", {"anything": "goes here"}),
        ("simulator/command", {"speed": 2}),
    ],
)
def test_valid_requests_pass(name: str, content: dict[str, Any]) -> None:
    services.SERVICES[name].check(content)


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("command", {}, "missing field 'command'"),
        ("mission/send", {"x_m": "1", "y_m": 0.0}, "x_m: expected a number, not '1'"),
        ("mission/send", {"x_m": True, "y_m": 0.0}, "x_m: expected a number, not True"),
        ("mission/send", {"x_m": 1.0, "y_m": 0.0, "yaw_rad": None}, "yaw_rad: expected a number"),
        ("mission/send", {"x_m": 1.0, "y_m": 0.0, "speed": 1.0}, "unknown field 'speed'; its fields: x_m"),
        ("mission/state", {"mission": 1.5}, "mission: expected an integer"),
        ("command", {"command": 7}, "command: expected a string"),
        ("parameters/get", {"kp": 1.0}, "unknown field 'kp'; its fields: none"),
    ],
)
def test_invalid_requests_are_refused(name: str, content: dict[str, Any], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        services.SERVICES[name].check(content)
