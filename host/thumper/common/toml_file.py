"""Read a TOML file of limited size, depth and integers."""

import tomllib
from pathlib import Path
from typing import Any

from thumper.common.files import read_text

MAX_MB = 1.0
MAX_DEPTH = 16
MAX_INTEGER = 2**63  # TOML promises 64 bits


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
