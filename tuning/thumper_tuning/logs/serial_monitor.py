"""Lines copied from a serial monitor: time stamps before them, or `name:value` pairs of a serial plotter."""

import re

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.logs.dialect import to_number

STAMP = re.compile(r"\s*(\d\d:\d\d:\d\d[.,]\d+)\s*->\s*")
PAIR = re.compile(r"([^\W\d][^\s:,]*):\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)(?=[\s,;]|$)")
BETWEEN_PAIRS = " \t,;"
MIN_SHARE = 0.8  # of the lines; the others are cut off or boot messages


def split_stamps(lines: list[str]) -> tuple[list[str], FloatArray | None]:
    """Return the lines without the monitor's time stamps, and these [s], shape (n,); None: no stamps."""
    found = [STAMP.match(line) for line in lines]
    if sum(map(bool, found)) < MIN_SHARE * max(len(lines), 1):
        return lines, None
    rest = [line[match.end() :] if match else line for line, match in zip(lines, found, strict=True)]
    stamps = [to_number(match[1].replace(",", ".")) if match else np.nan for match in found]
    return rest, np.array(stamps)


def pairs_to_rows(lines: list[str]) -> list[str] | None:
    """Return a header and one row for each line of `time:123 pwm:80 speed:3.2`; None for other text."""
    found = [_pairs(line) for line in lines]
    names = next((tuple(pairs) for pairs in found if len(pairs) > 1), ())
    if not names or sum(map(bool, found)) < MIN_SHARE * len(lines):
        return None
    return [",".join(names), *(",".join(pairs.get(name, "") for name in names) for pairs in found)]


def _pairs(line: str) -> dict[str, str]:
    """Return the pairs of a line; empty if it holds anything else."""
    return {} if PAIR.sub("", line).strip(BETWEEN_PAIRS) else dict(PAIR.findall(line))
