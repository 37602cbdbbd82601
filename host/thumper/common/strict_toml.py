"""Read a TOML file into a dataclass of options. Unknown keys, wrong types and bad values are errors."""

import json
import math
from collections.abc import Mapping
from dataclasses import is_dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar, cast, get_type_hints

from pydantic import TypeAdapter, ValidationError

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.texts import choice_hint
from thumper.common.toml_file import load_toml

T = TypeVar("T")
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
    try:
        data = load_toml(path)
    except OSError as error:
        raise ThumperError(
            f"{path}: cannot read the {what}: {error.strerror}", exit_code=EXIT_USAGE
        ) from error
    except ValueError as error:
        raise ThumperError(f"{path}: not valid TOML: {error}", exit_code=EXIT_USAGE) from error
    _check_keys(data, options_type, path, "", removed)
    try:
        # Through JSON, because strict mode accepts a table for a dataclass only there.
        return adapter.validate_json(json.dumps(with_new_names(data, renamed), default=str), strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        # Do not print a whole table: it may hold a secret.
        is_table = first["type"] == "missing" or isinstance(first["input"], dict)
        setting = key if is_table else f"{key} = {first['input']!r}"
        reason = first["msg"].removeprefix("Value error, ")
        raise ThumperError(f"{path}: {setting}: {reason}", exit_code=EXIT_USAGE) from error


def _check_keys(
    table: dict[str, Any], options_type: type, path: Path, prefix: str, removed: Mapping[str, str]
) -> None:
    """Raise for the first unknown key: pydantic ignores unknown keys of plain dataclasses.

    Add the keys of a table that wants to know them as its value `stated`.
    """
    types = get_type_hints(options_type)
    wants_keys = types.pop(STATED, None) is not None
    for key, value in table.items():
        if key not in types:
            if reason := removed.get(f"{prefix}{key}"):
                raise ThumperError(f"{path}: {prefix}{key} was removed: it {reason}", exit_code=EXIT_USAGE)
            hint = choice_hint(key, sorted(types))
            raise ThumperError(f"{path}: unknown key {prefix}{key}; {hint}", exit_code=EXIT_USAGE)
        if isinstance(value, dict) and is_dataclass(types[key]):
            _check_keys(value, cast("type", types[key]), path, f"{prefix}{key}.", removed)
        elif isinstance(value, float) and not math.isfinite(value):
            raise ThumperError(f"{path}: {prefix}{key} = {value}: give a finite number", exit_code=EXIT_USAGE)
    if wants_keys:
        table[STATED] = list(table)
