"""A figure beside its aim and what others reach: printed, and kept for the table of `make bench`."""

import json
import os
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

KEEP = "THUMPER_FIGURES"
"""Environment: the file that `make bench` gathers; without it figures are only printed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """A row of the table."""

    what: str
    ours: str
    unit: str = ""
    aim: str = ""
    peers: str = ""
    source: str = ""  # of the peers' figures


def figure(what: str, ours: str, unit: str = "", *, aim: str = "", peers: str = "", source: str = "") -> None:
    """Print a figure as a line, and keep it if somebody gathers."""
    row = Figure(what=what, ours=ours, unit=unit, aim=aim, peers=peers, source=source)
    beside = [f"aim {aim}"] * bool(aim) + [peers] * bool(peers)
    print(f"{what:44} {ours:>22} {unit:14} {'; '.join(beside)}".rstrip(), flush=True)
    if KEEP in os.environ:
        with Path(os.environ[KEEP]).open("a", encoding="utf-8") as rows:
            rows.write(json.dumps(asdict(row)) + "\n")


def there(path: Path) -> bool:
    """Whether the recorded data are there; if not it says so, also in the table."""
    if not path.exists():
        figure(f"data not there: {path.name}", "-")
        print(f"  there is no {path}; THUMPER_DATA names the folder that holds the recorded data")
    return path.exists()


def need(path: Path) -> None:
    """Go on if the recorded data are there; else leave the benchmark with 0."""
    if not there(path):
        sys.exit(0)
