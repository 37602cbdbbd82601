"""Read a scenario's TOML, which schedules faults by simulated time.

faults = [
  { at_s = 3.0, encoder.left.b = "cut" },
  { at_s = 5.0, line.noise = 0.01, battery.charge = 0.05 },
]
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.toml_file import load_toml
from thumper_hil.faults.catalogue import FaultError, fault_action
from thumper_hil.faults.switches import Switches


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """A fault and the simulated time at which it occurs."""

    time_s: float
    name: str
    apply: Callable[[Switches], None]


def load_scenario(path: Path) -> list[Event]:
    """Read a scenario; return its events sorted by time.

    Raises
    ------
    ThumperError
        The file cannot be read or an entry is invalid; the message names file and entry.
    """
    try:
        return parse_scenario(load_toml(path))
    except (OSError, ValueError) as error:  # FaultError is a ValueError
        reason = error.strerror if isinstance(error, OSError) else error
        raise ThumperError(f"{path}: {reason}", exit_code=EXIT_USAGE) from error


def parse_scenario(data: dict[str, Any]) -> list[Event]:
    """Return the events of a scenario, sorted by time; raise FaultError if an entry is invalid."""
    for key in data:
        if key not in {"description", "faults"}:
            raise FaultError(f"unknown key {key}; choose from description, faults")
    rows = data.get("faults", [])
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise FaultError('faults: must be a list of entries such as { at_s = 3.0, encoder.left.b = "cut" }')
    events = [event for number, row in enumerate(rows) for event in _events(row, f"faults[{number}]")]
    return sorted(events, key=lambda event: event.time_s)


def _events(row: dict[str, Any], where: str) -> Iterator[Event]:
    time_s = row.get("at_s")
    if isinstance(time_s, bool) or not isinstance(time_s, int | float) or not 0.0 <= time_s < math.inf:
        raise FaultError(f"{where}.at_s = {time_s!r}: must be the time in simulated seconds since power-on")
    faults = list(_leaves({key: value for key, value in row.items() if key != "at_s"}))
    if not faults:
        raise FaultError(f"{where}: no fault given; add one next to at_s")
    for name, value in faults:
        try:
            yield Event(time_s=float(time_s), name=name, apply=fault_action(name, value))
        except FaultError as error:
            raise FaultError(f"{where}: {error}") from None


def _leaves(table: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values of nested tables with their dotted keys."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value
