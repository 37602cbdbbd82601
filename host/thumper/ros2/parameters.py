"""The node's parameters: those of the board, and use_sim_time. For `ros2 param` and rqt."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from thumper.bus.client import BusClient
from thumper.common.errors import ThumperError
from thumper.ros import services
from thumper.ros.codec import Message, message
from thumper.ros.to_json import from_json
from thumper.ros2.node import RosNode, ServiceCall

NOT_SET, BOOL, INTEGER, DOUBLE = 0, 1, 2, 3  # of rcl_interfaces/ParameterType
USE_SIM_TIME = "use_sim_time"

Answer = Callable[[Message], dict[str, Any]]


class RosParameters:
    """Answers the six parameter services of the node. The board checks ranges and refuses as always."""

    def __init__(self, bus: BusClient, node: RosNode) -> None:
        self._bus = bus
        self.simulated = False
        bus.subscribe("status", self._on_status)
        self._serve(node, "list_parameters", "ListParameters", self._list)
        self._serve(node, "describe_parameters", "DescribeParameters", self._describe)
        self._serve(node, "get_parameters", "GetParameters", self._get)
        self._serve(node, "get_parameter_types", "GetParameterTypes", self._types)
        self._serve(node, "set_parameters", "SetParameters", self._set)
        self._serve(node, "set_parameters_atomically", "SetParametersAtomically", self._set_all)

    def _on_status(self, status: Message) -> None:
        self.simulated = bool(status.simulated)

    @staticmethod
    def _serve(node: RosNode, name: str, kind: str, answer: Answer) -> None:
        type_name = f"rcl_interfaces/srv/{kind}"

        def reply(call: ServiceCall) -> None:
            call.reply(message(f"{type_name}_Response", **answer(call.request)))

        node.serve(f"~/{name}", type_name, reply)

    def _values(self) -> dict[str, float | bool]:
        try:
            board = services.PARAMETERS_GET.call(self._bus).values
        except ThumperError:  # no robot: its parameters are not known
            board = {}
        return {USE_SIM_TIME: self.simulated, **board}

    def _schema(self) -> dict[str, Mapping[str, Any]]:
        try:
            schema = services.PARAMETERS_SCHEMA.call(self._bus).parameters
        except ThumperError:
            schema = []
        return {one["name"]: one for one in schema}

    def _list(self, _request: Message) -> dict[str, Any]:
        names = sorted(self._values())
        return {"result": message("rcl_interfaces/msg/ListParametersResult", names=names, prefixes=[])}

    def _get(self, request: Message) -> dict[str, Any]:
        values = self._values()
        return {"values": [_value(values.get(name)) for name in request.names]}

    def _types(self, request: Message) -> dict[str, Any]:
        values = self._values()
        return {"types": np.array([_type(values.get(name)) for name in request.names], dtype=np.uint8)}

    def _describe(self, request: Message) -> dict[str, Any]:
        values, schema = self._values(), self._schema()
        return {
            "descriptors": [_descriptor(name, values.get(name), schema.get(name)) for name in request.names]
        }

    def _set(self, request: Message) -> dict[str, Any]:
        return {"results": [self._change([one]) for one in request.parameters]}

    def _set_all(self, request: Message) -> dict[str, Any]:
        return {"result": self._change(request.parameters)}

    def _change(self, parameters: list[Message]) -> Message:
        """Set all or none, and say why not."""
        content = {}
        reason = ""
        for one in parameters:
            kind = one.value.type
            if one.name == USE_SIM_TIME:
                if kind != BOOL or one.value.bool_value != self.simulated:
                    reason = f"{USE_SIM_TIME} follows from the robot: {self.simulated}"
            elif kind in (DOUBLE, INTEGER):
                value = one.value.double_value if kind == DOUBLE else one.value.integer_value
                content[one.name] = float(value)
                if not math.isfinite(value):
                    reason = f"{one.name} must be finite"
            else:
                reason = f"{one.name} is a number"
        if content and not reason:
            try:
                services.PARAMETERS_SET.call(self._bus, content)
            except ThumperError as error:
                reason = str(error)
        return message("rcl_interfaces/msg/SetParametersResult", successful=not reason, reason=reason)


def _type(value: float | bool | None) -> int:
    if value is None:
        return NOT_SET
    return BOOL if isinstance(value, bool) else DOUBLE


def _value(value: float | bool | None) -> Message:
    kind = _type(value)
    fields: dict[str, Any] = {"type": kind, "bool_value": value is True}
    if kind == DOUBLE:
        fields["double_value"] = value
    return from_json("rcl_interfaces/msg/ParameterValue", fields)


def _descriptor(name: str, value: float | bool | None, limits: Mapping[str, Any] | None) -> Message:
    fields: dict[str, Any] = {"name": name, "type": _type(value), "read_only": limits is None}
    if limits is not None:
        span = {"from_value": limits["minimum"], "to_value": limits["maximum"]}
        fields |= {"description": limits["unit"], "floating_point_range": [span]}
    return from_json("rcl_interfaces/msg/ParameterDescriptor", fields)
