"""Print a figure next to its aim and the figures of others, and record it for `make bench`."""

import json
import os
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

FIGURES_VARIABLE = "THUMPER_FIGURES"
"""Environment variable with the file that `make bench` collects; without it figures are only printed."""


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
    """Print a figure as a line, and record it if `FIGURES_VARIABLE` is set."""
    row = Figure(what=what, ours=ours, unit=unit, aim=aim, peers=peers, source=source)
    comparison = [f"aim {aim}"] * bool(aim) + [peers] * bool(peers)
    print(f"{what:44} {ours:>22} {unit:14} {'; '.join(comparison)}".rstrip(), flush=True)
    if FIGURES_VARIABLE in os.environ:
        with Path(os.environ[FIGURES_VARIABLE]).open("a", encoding="utf-8") as rows:
            rows.write(json.dumps(asdict(row)) + "\n")


def has_data(path: Path) -> bool:
    """Return True if the recorded data exist; otherwise print a note and record it in the table."""
    if not path.exists():
        figure(f"no data: {path.name}", "-")
        print(f"  {path} does not exist; set THUMPER_DATA to the folder with the recorded data")
    return path.exists()


def require_data(path: Path) -> None:
    """Exit with status 0 if the recorded data do not exist."""
    if not has_data(path):
        sys.exit(0)
