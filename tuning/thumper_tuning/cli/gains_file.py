"""gains.json: the designed gains, for `tune verify` and other programs."""

import dataclasses
import json
from pathlib import Path

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.files import read_text, write_text
from thumper_tuning.design.fixed_point import BoardGains, to_fixed_point
from thumper_tuning.design.gains import Design

MAX_MB = 1.0


def write_gains_file(path: Path, design: Design) -> Path:
    """Write the gains, their integers on the wire, the model and Ms."""
    content = {
        "gains": dict(design.gains.items()),
        "wire": design.gains.wire_values(),
        "period_s": design.period_s,
        "model": dataclasses.asdict(design.model),
        "Ms": design.margins.max_sensitivity,
    }
    write_text(path, json.dumps(content, indent=2) + "\n")
    return path


def read_gains_file(path: Path) -> BoardGains:
    """Read the gains that `tune design` wrote.

    Raises
    ------
    ThumperError
        The file cannot be read, or a gain is missing or out of range.
    """
    names = [entry.name for entry in dataclasses.fields(BoardGains)]
    try:
        gains = json.loads(read_text(path, MAX_MB))["gains"]
        return to_fixed_point(**{name: float(gains[name]) for name in names})
    except OSError as error:
        raise ThumperError(
            f"{path}: cannot read the gains: {error.strerror}", exit_code=EXIT_USAGE
        ) from error
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise ThumperError(
            f"{path}: does not have all of {', '.join(names)}; write it with `thumper tune design`",
            exit_code=EXIT_USAGE,
        ) from error
