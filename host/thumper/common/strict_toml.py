"""Read a TOML file into a dataclass of options. Unknown keys, wrong types and bad values are errors."""

import json
import math
import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import is_dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar, cast, get_type_hints

from pydantic import ConfigDict, TypeAdapter, ValidationError

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.texts import choice_hint, close_names
from thumper.common.toml_file import line_of, load_toml

T = TypeVar("T")
STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)
"""Of a dataclass whose tables have no other keys, and whose numbers are finite."""
STATED = "stated"
"""Field of an options class for the keys that the file sets; no key itself."""


Renamed = Mapping[tuple[str, str], Mapping[str, str]]
"""By table and key: the values of earlier versions, and their names today."""


def with_new_names(data: dict[str, Any], renamed: Renamed) -> dict[str, Any]:
    """Return the tables with the values of earlier versions under their names today."""
    for (table, key), values in renamed.items():
        options = data.get(table)
        if isinstance(options, dict) and isinstance(old := options.get(key), str) and old in values:
            data = {**data, table: {**options, key: values[old]}}
    return data


def read_checked(
    path: Path,
    adapter: TypeAdapter[T],
    options_type: type[T],
    what: str,
    *,
    removed: Mapping[str, str] = MappingProxyType({}),
    renamed: Renamed = MappingProxyType({}),
) -> T:
    """Read the TOML file at `path` into the dataclass `options_type`; errors call the file a `what`.

    `removed` maps a key or table of earlier versions, with its full path, to what the error says about it.
    `renamed` is that of `with_new_names`.

    Raises
    ------
    ThumperError
        The file cannot be read, is not valid TOML, or has a wrong key, type or value. The error names it.
    """
    data = read_tables(path, what)
    _check_keys(data, options_type, path, "", removed, list(_key_paths(options_type)))
    try:
        # Through JSON, because strict mode accepts a table for a dataclass only there.
        return adapter.validate_json(json.dumps(with_new_names(data, renamed), default=str), strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        # Do not print a whole table: it may hold a secret.
        is_table = first["type"] == "missing" or isinstance(first["input"], dict)
        setting = key if is_table else f"{key} = {first['input']!r}"
        reason = first["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
        raise ThumperError(
            f"{place_of(path, *first['loc'])}: {setting}: {reason}", exit_code=EXIT_USAGE
        ) from error


def read_tables(path: Path, what: str) -> dict[str, Any]:
    """Return the content of a TOML file; raise ThumperError if it cannot be read or is not valid TOML."""
    try:
        return load_toml(path)
    except OSError as error:
        raise ThumperError(
            f"{path}: cannot read the {what} ({error.strerror}); check the path", exit_code=EXIT_USAGE
        ) from error
    except ValueError as error:
        problem, line = _problem_and_line(error)
        raise ThumperError(f"{path}{line}: not valid TOML: {problem}", exit_code=EXIT_USAGE) from error


def place_of(path: Path, *keys: str | int) -> str:
    """Return `PATH:LINE` of a key of a TOML file that was read; the path alone if no line sets it."""
    with suppress(OSError, ValueError):  # the file may have changed since
        line = line_of(path, keys)
        if line is not None:
            return f"{path}:{line}"
    return str(path)


def _problem_and_line(error: ValueError) -> tuple[str, str]:
    """Return what tomllib says, and the line as `:LINE`, empty if it says none."""
    text = str(error)
    place = re.search(r" \(at line (\d+), column \d+\)$", text)
    problem = text[: place.start()] if place else text
    return problem[:1].lower() + problem[1:], f":{place[1]}" if place else ""


def _key_paths(options_type: type, prefix: str = "") -> Iterator[str]:
    """Yield the full path of every key of the options."""
    for key, kind in get_type_hints(options_type).items():
        if key != STATED:
            yield f"{prefix}{key}"
        if is_dataclass(kind):
            yield from _key_paths(cast("type", kind), f"{prefix}{key}.")


def _key_hint(path: str, here: list[str], key_paths: Collection[str]) -> str:
    """Return the fix for an unknown key: the same key in a table below or elsewhere, or one of this table."""
    table, _, key = path.rpartition(".")
    same = [known for known in key_paths if known.endswith(f".{key}")]
    below = [known for known in same if known.startswith(f"{table}.")]
    if below or (same and not close_names(key, here)):
        return f"did you mean {' or '.join((below or same)[:2])}?"
    return choice_hint(key, here)


def _check_keys(
    table: dict[str, Any],
    options_type: type,
    path: Path,
    prefix: str,
    removed: Mapping[str, str],
    key_paths: Collection[str],
) -> None:
    """Raise for the first unknown key: pydantic ignores unknown keys of plain dataclasses.

    Add the keys of a table that wants to know them as its value `stated`. `key_paths` are those of the file.
    """
    types = get_type_hints(options_type)
    wants_keys = types.pop(STATED, None) is not None
    for key, value in table.items():
        full = f"{prefix}{key}"
        if key not in types:
            place = place_of(path, *full.split("."))
            if reason := removed.get(full):
                raise ThumperError(f"{place}: {full} was removed: it {reason}", exit_code=EXIT_USAGE)
            hint = _key_hint(full, sorted(types), key_paths)
            raise ThumperError(f"{place}: unknown key {full}; {hint}", exit_code=EXIT_USAGE)
        if isinstance(value, dict) and is_dataclass(types[key]):
            _check_keys(value, cast("type", types[key]), path, f"{full}.", removed, key_paths)
        elif isinstance(value, float) and not math.isfinite(value):
            place = place_of(path, *full.split("."))
            raise ThumperError(f"{place}: {full} = {value}: give a finite number", exit_code=EXIT_USAGE)
    if wants_keys:
        table[STATED] = list(table)
