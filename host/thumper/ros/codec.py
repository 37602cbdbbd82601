"""ROS 2 messages to bytes (CDR) and back, without ROS.

The types are those of ROS 2 Jazzy, as the `rosbags` package holds them, and our own. Loading them takes a
tenth of a second: import this module where it is used.
"""

from functools import cache
from typing import Any

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from thumper.ros.custom_messages import OWN_MESSAGES

Message = Any  # a dataclass that `rosbags` generates from the definition, with `__msgtype__`

LARGEST_SEQUENCE = 16_000_000  # cells of a map; a broken length must not ask for all memory


@cache
def typestore() -> Typestore:
    """Give the standard types and our own."""
    store = get_typestore(Stores.ROS2_JAZZY)
    store.max_sequence_length = LARGEST_SEQUENCE
    for name, definition in OWN_MESSAGES.items():
        store.register(get_types_from_msg(definition, name))
    return store


def message(type_name: str, **fields: Any) -> Message:
    """Build a message; raises TypeError unless every field is given."""
    return typestore().types[type_name](**fields)


def encode(of: Message) -> bytes:
    """Return the message as CDR, with its 4-byte header."""
    return bytes(typestore().serialize_cdr(of, of.__msgtype__))


def decode(raw: bytes | memoryview, type_name: str) -> Message:
    """Read CDR of any origin.

    Raises
    ------
    ValueError
        The bytes are no message of this type.
    KeyError
        No such type.
    """
    typestore().get_msgdef(type_name)
    try:
        return typestore().deserialize_cdr(raw, type_name)
    except Exception as error:  # whatever the parser trips over: the bytes are at fault
        raise ValueError(f"no {type_name}: {error}") from error


def definition(type_name: str) -> str:
    """Return the type's definition with all that it refers to, as ROS 2 tools store it beside messages."""
    return typestore().generate_msgdef(type_name, ros_version=2)[0]
