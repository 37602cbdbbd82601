"""Write the C++ header, the Python codec and docs/reference/protocol.md from messages.toml.

Run `python firmware/protocol/generate.py` after editing messages.toml. `--check` writes nothing and
fails if a file is stale.
"""

import argparse
import json
import sys
import textwrap
import tomllib
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2

HERE = Path(__file__).resolve().parent
REPO = HERE.parents[1]
SCHEMA = HERE / "messages.toml"
OUTPUTS = {
    "messages.hpp.jinja": REPO / "firmware/core/messages.hpp",
    "messages.py.jinja": REPO / "host/thumper/board/messages.py",
    "protocol.md.jinja": REPO / "docs/reference/protocol.md",
}
# Names of enums in Python that differ from the schema's, which the hash covers: `Board` is the driver there.
PYTHON_ENUMS = {"Board": "BoardModel"}
# wire type: (bytes, struct character, C++ type, lowest, highest)
TYPES = {
    "u8": (1, "B", "uint8_t", 0, 2**8 - 1),
    "i16": (2, "h", "int16_t", -(2**15), 2**15 - 1),
    "u16": (2, "H", "uint16_t", 0, 2**16 - 1),
    "i32": (4, "i", "int32_t", -(2**31), 2**31 - 1),
    "u32": (4, "I", "uint32_t", 0, 2**32 - 1),
}

Schema = dict[str, Any]  # parsed TOML; check_schema enforces its shape


def load_schema(path: Path = SCHEMA) -> Schema:
    """Read and validate a schema.

    Raises
    ------
    ValueError
        If names, ids or values are not unique, a type or enum is unknown, or a parameter does not fit its
        range or wire type.
    """
    with path.open("rb") as file:
        schema: Schema = tomllib.load(file)
    for message in schema["message"]:
        message["fields"] = [{"unit": "", "enum": "", **field} for field in message["fields"]]
    check_schema(schema)
    return schema


def check_schema(schema: Schema) -> None:
    """Raise ValueError for the first invalid entry, naming it."""
    check_unique(schema)
    for enum in schema["enum"]:
        values = [v["value"] for v in enum["values"]]
        if len(set(values)) != len(values) or not all(0 <= v <= 255 for v in values):
            raise ValueError(f"enum {enum['name']}: values must be distinct and within 0..255")
    for message in schema["message"]:
        check_message(message, {enum["name"] for enum in schema["enum"]})
    identity = next(m for m in schema["message"] if m["name"] == "identity")
    if identity["fields"][0]["name"] != "schema_hash" or identity["fields"][0]["type"] != "u32":
        raise ValueError("identity must begin with schema_hash, u32; the host needs it to report a mismatch")
    for spec in schema["parameter"]:
        if not spec["minimum"] <= spec["default"] <= spec["maximum"]:
            raise ValueError(f"parameter {spec['name']}: the default is outside its range")
        if max(abs(spec["minimum"]), abs(spec["maximum"])) * spec["scale"] >= 2**15:
            raise ValueError(f"parameter {spec['name']}: the range times scale does not fit int16")


def check_unique(schema: Schema) -> None:
    """Raise ValueError if a name or a message id occurs twice."""
    for what, keys in {
        "enum name": [e["name"] for e in schema["enum"]],
        "message name": [m["name"] for m in schema["message"]],
        "message id": [m["id"] for m in schema["message"]],
        "parameter name": [p["name"] for p in schema["parameter"]],
    }.items():
        if len(set(keys)) != len(keys):
            raise ValueError(f"{what} used twice; make it unique: {keys}")


def check_message(message: Schema, enums: set[str]) -> None:
    """Raise ValueError if the id does not suit the sender, or a field has an unknown type or enum."""
    if (message["id"] >= 0x80) != (message["from"] == "firmware") or not 0 < message["id"] <= 0xFF:
        raise ValueError(f"message {message['name']}: firmware ids start at 0x80, host ids are below")
    for field in message["fields"]:
        name = f"{message['name']}.{field['name']}"
        if field["type"] not in TYPES:
            raise ValueError(f"{name}: unknown wire type {field['type']}")
        if field["enum"] and (field["enum"] not in enums or field["type"] != "u8"):
            raise ValueError(f"{name}: an enum field needs a known enum and type u8")


def schema_hash(schema: Schema) -> int:
    """Return the CRC-32 (zlib) of the schema as canonical JSON without its `doc` texts."""

    def bare(node: Any) -> Any:
        if isinstance(node, Mapping):
            return {key: bare(value) for key, value in node.items() if key != "doc"}
        return [bare(item) for item in node] if isinstance(node, list) else node

    return zlib.crc32(json.dumps(bare(schema), sort_keys=True, separators=(",", ":")).encode())


def camel(name: str) -> str:
    """Convert `set_wheel_speeds` or `E_STOP` to `SetWheelSpeeds` or `EStop`."""
    return "".join(part.capitalize() for part in name.lower().split("_"))


def python_enum(name: str) -> str:
    """Return the name of an enum in the Python codec."""
    return PYTHON_ENUMS.get(name, name)


def payload_size(message: Schema) -> int:
    """Return the payload size of a message in bytes."""
    return sum(TYPES[field["type"]][0] for field in message["fields"])


def wrap(text: str, prefix: str, width: int = 100) -> str:
    """Wrap `text` with a comment prefix on each line."""
    return "\n".join(textwrap.wrap(text, width=width, initial_indent=prefix, subsequent_indent=prefix))


def render(schema: Schema) -> dict[Path, str]:
    """Return the text of every generated file by path."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(HERE),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters.update(camel=camel, python_enum=python_enum, size=payload_size, wrap=wrap)
    context = {
        "schema": schema,
        "types": TYPES,
        "hash": schema_hash(schema),
        "largest_from_host": max(payload_size(m) for m in schema["message"] if m["from"] == "host"),
        "largest": max(payload_size(m) for m in schema["message"]),
    }
    return {path: environment.get_template(name).render(context) for name, path in OUTPUTS.items()}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; fail if a file is stale")
    check = parser.parse_args().check
    stale = [
        (path, text)
        for path, text in render(load_schema()).items()
        if not path.exists() or path.read_text(encoding="utf-8") != text
    ]
    for path, text in stale:
        print(f"{'stale' if check else 'wrote'}: {path.relative_to(REPO)}")
        if not check:
            path.write_text(text, encoding="utf-8")
    if check and stale:
        print("run: python firmware/protocol/generate.py")
    return 1 if check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
