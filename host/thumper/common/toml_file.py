"""Read a TOML file of limited size, depth and integers."""

import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from thumper.common.files import read_text

MAX_MB = 1.0
MAX_DEPTH = 16
MAX_INTEGER = 2**63  # TOML promises 64 bits
TABLE = re.compile(r"\s*(\[\[?)([^\[\]]+)\]")
KEY = re.compile(r"""\s*([\w."' -]+?)\s*=""")


def load_toml(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file.

    Raises
    ------
    OSError
        The file cannot be read, is no regular file, or is too large.
    ValueError
        It is not valid TOML, is nested too deeply, or has an integer beyond 64 bits.
    """
    text = read_text(path, MAX_MB)
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise ValueError(f"nested more than {MAX_DEPTH} levels deep") from None
    except tomllib.TOMLDecodeError:
        raise
    except ValueError as error:  # Python refuses integers of more than 4300 digits
        raise ValueError("an integer is too large for 64 bits") from error
    _check(data)
    return data


def line_of(path: Path, keys: Sequence[str | int]) -> int | None:
    """Return the line that sets a key, or the nearest table or list that holds it; None if no line does.

    `keys` lead from the file's top to the key; a number is a place in a list.
    """
    table: tuple[str | int, ...] = ()
    counts: dict[tuple[str | int, ...], int] = {}  # of the tables of a list
    best: tuple[int, int | None] = (0, None)
    for number, line in enumerate(read_text(path, MAX_MB).splitlines(), start=1):
        if match := TABLE.match(line):
            table = _names(match[2])
            if match[1] == "[[":
                counts[table] = counts.get(table, -1) + 1
                table = (*table, counts[table])
            here = table
        elif match := KEY.match(line):
            here = (*table, *_names(match[1]))
        else:
            continue
        if len(here) > best[0] and here == tuple(keys[: len(here)]):
            best = len(here), number
    return best[1]


def _names(dotted: str) -> tuple[str, ...]:
    return tuple(name.strip(" \"'") for name in dotted.split("."))


def _check(data: dict[str, Any]) -> None:
    remaining: list[tuple[Any, int]] = [(data, 0)]
    while remaining:
        value, depth = remaining.pop()
        if depth > MAX_DEPTH:
            raise ValueError(f"nested more than {MAX_DEPTH} levels deep")
        if isinstance(value, dict | list):
            children = value.values() if isinstance(value, dict) else value
            remaining += [(child, depth + 1) for child in children]
        elif isinstance(value, int) and not -MAX_INTEGER <= value < MAX_INTEGER:
            raise ValueError("an integer is too large for 64 bits")
