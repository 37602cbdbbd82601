"""Parameters of a test of which `make test` takes some, and `make test-all` takes all."""

from collections.abc import Iterable
from typing import Any

import pytest


def some_of(values: Iterable[Any], fast: int = 1) -> list[Any]:
    """Return the first `fast` values, and the others with the mark `slow`."""
    return [
        value if number < fast else pytest.param(*_fields(value), marks=pytest.mark.slow)
        for number, value in enumerate(values)
    ]


def _fields(value: Any) -> tuple[Any, ...]:
    return value if isinstance(value, tuple) else (value,)
