"""Convert ROS 2 messages to JSON and back, field by field."""

import math
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from thumper.ros.codec import Message, message, typestore

_BASE, _NAME, _ARRAY = Nodetype.BASE, Nodetype.NAME, Nodetype.ARRAY
INTEGERS = {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)} | {"byte", "char"}


def to_json(msg: Any) -> Any:
    """Return a message as dictionaries, lists and numbers; NaN and infinity become null."""
    type_name = getattr(msg, "__msgtype__", None)
    if type_name is not None:
        fields = typestore().fielddefs[type_name][1]  # without the type's constants
        return {name: to_json(getattr(msg, name)) for name, _ in fields}
    if isinstance(msg, np.ndarray):
        return [to_json(value) for value in msg.tolist()] if msg.dtype.kind == "f" else msg.tolist()
    if isinstance(msg, list | tuple):
        return [to_json(value) for value in msg]
    if isinstance(msg, float) and not math.isfinite(msg):
        return None
    return msg


def from_json(type_name: str, content: Any) -> Message:
    """Build the message that the JSON describes; missing fields are zero or empty.

    Raises
    ------
    ValueError
        A field is unknown, or its type cannot hold the value. The error names the field.
    """
    if not isinstance(content, dict):
        raise ValueError(f"{type_name}: expected an object")
    fields = dict(typestore().fielddefs[type_name][1])
    if unknown := sorted(set(content) - set(fields)):
        raise ValueError(
            f"{type_name} has no field {', '.join(map(repr, unknown))}; its fields: {', '.join(fields)}"
        )
    values = {}
    for name, (kind, of) in fields.items():
        try:
            values[name] = _value(kind, of, content.get(name))
        except (ValueError, OverflowError) as error:
            raise ValueError(f"{name}: {error}") from error
    return message(type_name, **values)


def _value(kind: Nodetype, of: Any, content: Any) -> Any:
    """Convert one field; None stands for a missing field, and for a float that is NaN or infinite."""
    if kind is _NAME:
        return from_json(of, {} if content is None else content)
    if kind is _BASE:
        return _scalar(of[0], content)
    (item_kind, item_of), length = of
    content = [] if content is None else content
    if not isinstance(content, list):
        raise ValueError("expected a list")
    if kind is _ARRAY:
        content = content or [None] * length
        if len(content) != length:
            raise ValueError(f"{len(content)} values instead of {length}")
    values = [_value(item_kind, item_of, item) for item in content]
    if item_kind is _BASE and item_of[0] != "string":
        return np.array(values, dtype=_dtype(item_of[0]))
    return values


def _scalar(type_name: str, content: Any) -> Any:
    if type_name == "string":
        if not isinstance(content, str | None):
            raise ValueError(f"{content!r} is not a string")
        return content or ""
    if type_name == "bool":
        if not isinstance(content, bool | None):
            raise ValueError(f"{content!r} is neither true nor false")
        return bool(content)
    if isinstance(content, bool) or not isinstance(content, int | float | None):
        raise ValueError(f"{content!r} is not a number")
    if type_name in INTEGERS:
        value, limits = 0 if content is None else content, np.iinfo(_dtype(type_name))
        if not limits.min <= value <= limits.max or value != int(value):
            raise ValueError(f"{value!r} does not fit in {type_name}")
        return int(value)
    return 0.0 if content is None else float(content)


def _dtype(type_name: str) -> np.dtype[Any]:
    return np.dtype({"byte": "u1", "char": "u1"}.get(type_name, type_name))
