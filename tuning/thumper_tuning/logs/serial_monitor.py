"""Lines copied from a serial monitor: time stamps before them, `name:value` pairs, Teleplot's lines."""

import re
from collections import Counter

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.logs.numbers import to_number

NUMBER = r"[-+]?\d*[.,]?\d+(?:[eE][-+]?\d+)?"
STAMP = re.compile(r"\s*(\d\d:\d\d:\d\d[.,]\d+)\s*->\s*")
# `pwm:80`, `Motor speed = 3.2 rad/s`, `"pwm": 80` of a JSON line. Only known units may follow a number.
UNIT = r"(?:[munµ]?s|sec|m?[VA]|%|rpm|RPM|(?:rad|deg|rev|counts|ticks)(?:/s)?|°(?:/s)?|tr/min|1/min|U/min)"
PAIR = re.compile(rf"([^\W\d][^:=,;\t]{{0,40}}?)\s*[:=]\s*({NUMBER})(?:\s*({UNIT}))?(?=[\s,;]|$)(?!\s*[:=])")
BETWEEN_PAIRS = " \t,;"
JSON_MARKS = str.maketrans("", "", '{}"')
TELEPLOT = re.compile(rf">([^:|§]+):(?:(\d+(?:\.\d+)?):)?({NUMBER})(?:§([^|]*))?(?:\|\w*)?\s*")
MIN_SHARE = 0.8  # of the lines; the others are cut off or boot messages


def split_stamps(lines: list[str]) -> tuple[list[str], FloatArray | None]:
    """Return the lines without the monitor's time stamps, and these [s], shape (n,); None: no stamps."""
    found = [STAMP.match(line) for line in lines]
    if sum(map(bool, found)) < MIN_SHARE * max(len(lines), 1):
        return lines, None
    rest = [line[match.end() :] if match else line for line, match in zip(lines, found, strict=True)]
    stamps = [to_number(match[1]) if match else np.nan for match in found]
    return rest, np.array(stamps)


def pairs_to_rows(lines: list[str]) -> list[str] | None:
    """Return a header and one row for each line of `time:123 pwm:80 speed:3.2`; None for other text."""
    found = [_pairs(line) for line in lines]
    names = next((tuple(pairs) for pairs in found if len(pairs) > 1), ())
    if not names or sum(map(bool, found)) < MIN_SHARE * len(lines):
        return None
    return _rows(names, found)


def plotted_to_rows(lines: list[str]) -> list[str] | None:
    """Return a header and rows of Teleplot's lines, `>pwm:1627551892437:80` or `>pwm:80`; None for others.

    Lines with one stamp are one row, which begins with the stamp. Without stamps, a name that comes again
    begins the next row.
    """
    found = [match for line in lines if (match := TELEPLOT.fullmatch(line.strip()))]
    if not found or len(found) < MIN_SHARE * len(lines):
        return None
    rows: list[dict[str, str]] = []
    for name, stamp, value, unit in (match.groups() for match in found):
        header = f"{name} [{unit}]" if unit else name
        if not rows or header in rows[-1] or (stamp and rows[-1].get("timestamp_ms") != stamp):
            rows.append({"timestamp_ms": stamp} if stamp else {})
        rows[-1][header] = value
    names = Counter(name for row in rows for name in row)
    return _rows(tuple(names), rows)


def _rows(names: tuple[str, ...], rows: list[dict[str, str]]) -> list[str]:
    return [";".join(names), *(";".join(row.get(name, "") for name in names) for row in rows)]


def _pairs(line: str) -> dict[str, str]:
    """Return the pairs of a line; empty if it holds anything else."""
    line = line.translate(JSON_MARKS)
    if PAIR.sub("", line).strip(BETWEEN_PAIRS):
        return {}
    return {f"{name.strip()} [{unit}]" if unit else name: value for name, value, unit in PAIR.findall(line)}
