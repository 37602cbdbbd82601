"""Keys, liveliness tokens, QoS and attachments of rmw_zenoh. Pure.

Source: docs/design.md of ros2/rmw_zenoh, which describes them for other implementations.
"""

import hashlib
import re
import struct
from dataclasses import dataclass
from typing import Self

BEST_EFFORT, RELIABLE = 2, 1  # as in rmw/types.h
TRANSIENT_LOCAL, VOLATILE = 1, 2
KEEP_LAST = 1

NODE, PUBLISHER, SUBSCRIPTION, SERVICE = "NN", "MP", "MS", "SS"
GID_BYTES = 16

_ATTACHMENT = struct.Struct("<qqB16s")


@dataclass(frozen=True, slots=True, kw_only=True)
class Qos:
    """The part of a QoS profile that the robot uses; the rest is ROS's default."""

    reliability: int = RELIABLE
    durability: int = VOLATILE
    depth: int = 10

    @property
    def is_latched(self) -> bool:
        """Whether late subscribers receive the newest messages."""
        return self.durability == TRANSIENT_LOCAL

    def encode(self) -> str:
        """Return the profile as in a liveliness token.

        An empty field means the default of the reader, which differs between releases: write what is known.
        """
        return f"{self.reliability}:{self.durability}:{KEEP_LAST},{self.depth}:,:,:,,"


@dataclass(frozen=True, slots=True, kw_only=True)
class Attachment:
    """What rmw_zenoh adds to each sample, request and reply."""

    sequence: int
    source_time_ns: int
    gid: bytes  # of the publisher or client

    def encode(self) -> bytes:
        """Return the 33 bytes: two little-endian int64, the length of the gid, the gid."""
        return _ATTACHMENT.pack(self.sequence, self.source_time_ns, GID_BYTES, self.gid)

    @classmethod
    def decode(cls, raw: bytes) -> Self:
        """Read the bytes of a request; raises ValueError."""
        if len(raw) != _ATTACHMENT.size or raw[16] != GID_BYTES:
            raise ValueError("not an attachment of rmw_zenoh")
        sequence, source_time_ns, _, gid = _ATTACHMENT.unpack(raw)
        return cls(sequence=sequence, source_time_ns=source_time_ns, gid=gid)


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeName:
    """A node in the ROS graph. `namespace` is empty or starts with a slash."""

    domain_id: int
    name: str
    namespace: str = ""

    def qualified(self, name: str) -> str:
        """Return the full name of a topic or service: absolute, private (`~/x`), or in the namespace."""
        if name.startswith("/"):
            return name
        if name.startswith("~/"):
            return f"{self.namespace}/{self.name}/{name[2:]}"
        return f"{self.namespace}/{name}"

    def data_key(self, full_name: str, type_name: str, type_hash: str) -> str:
        """Return the key of a topic's data or of a service."""
        return f"{self.domain_id}/{full_name.strip('/')}/{dds_type(type_name)}/{type_hash}"

    def node_token(self, session_id: str) -> str:
        """Return the liveliness token of the node itself, whose id is 0."""
        return self._token(session_id, 0, NODE)

    def endpoint_token(
        self, session_id: str, number: int, kind: str, endpoint: tuple[str, str, str], qos: Qos
    ) -> str:
        """Return the liveliness token of an endpoint, which is (full name, type, type hash)."""
        full_name, type_name, type_hash = endpoint
        end = f"{_mangled(full_name)}/{dds_type(type_name)}/{type_hash}/{qos.encode()}"
        return f"{self._token(session_id, number, kind)}/{end}"

    def _token(self, session_id: str, number: int, kind: str) -> str:
        place = f"%/{_mangled(self.namespace or '/')}/{self.name}"  # % is the enclave: none
        return f"@ros2_lv/{self.domain_id}/{session_id}/0/{number}/{kind}/{place}"


def node_name(robot: str) -> str:
    """Return a robot's name as ROS allows it: letters, digits and single `_`, no digit at the start."""
    name = re.sub("[-_]+", "_", robot)
    return f"robot_{name}" if name[0].isdigit() else name


def dds_type(type_name: str) -> str:
    """Return the DDS name of a type: std_msgs/msg/String is std_msgs::msg::dds_::String_."""
    package, folder, name = type_name.split("/")
    return f"{package}::{folder}::dds_::{name}_"


def gid_of(token: str) -> bytes:
    """Return an id of an endpoint that is unique in the graph; rmw_zenoh hashes the token otherwise."""
    return hashlib.blake2b(token.encode(), digest_size=GID_BYTES).digest()


def _mangled(name: str) -> str:
    return name.replace("/", "%")
