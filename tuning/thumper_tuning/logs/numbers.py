"""Read numbers as people write them: both decimal signs, thousands, units behind them, times of day."""

import math
import re
from collections import Counter
from datetime import date

# What separates thousands and can be nothing else, and the true minus sign.
PLAIN = str.maketrans({"\u2212": "-", **dict.fromkeys("\u00a0\u202f\u2009'\u2019", " ")})
GROUPS_OF_BLANKS = re.compile(r"(?<=\d) (?=\d{3}(?!\d))")
# May be thousands, may be three decimals: only the rest of the column shows it.
AMBIGUOUS = re.compile(r"[-+]?[1-9]\d{0,2}[.,]\d{3}")
THOUSANDS = re.compile(r"[-+]?\d{1,3}(?:([.,])\d{3})(?:\1\d{3})*(?:(?!\1)[.,]\d*)?")
INTEGER = re.compile(r"[-+]?([1-9]\d*)")
ENOUGH_VOTES = 50
UNIT_BEHIND = re.compile(r"([-+]?(?:\d[\d.,]*|[.,]\d+)(?:[eE][-+]?\d+)?)\s*([^\W\d][^\d,;|]{0,9}|[%°])")
MIN_UNIT_SHARE = 0.8  # of the cells have the same unit, else it is none
CLOCK = re.compile(
    r"(?:(\d{1,4})[-./](\d{1,2})[-./](\d{1,4})[T, ]+)?"
    r"(?:(\d{1,2}):)?(\d{1,2}):(\d{2}(?:[.,]\d+)?) ?(?:([ap])\.?m\.?)?(?:z|[-+]\d\d:?\d\d)?",
    re.IGNORECASE,
)


def read_columns(columns: list[list[str]], separator: str) -> list[tuple[list[float], str]]:
    """Return the numbers of each column, NaN for other text, and the unit behind them (empty: none).

    A column that does not show its decimal sign has that of the others. If no column shows one, a comma
    marks thousands in a file that separates its cells by commas, else it is the decimal sign.
    """
    columns = [[plain(cell) for cell in cells] for cells in columns]
    signs = [decimal_sign(cells) for cells in columns]
    votes = Counter(sign for sign in signs if sign)
    usual = votes.most_common(1)[0][0] if votes else "." if separator == "," else ""
    return [_read_column(cells, sign or usual) for cells, sign in zip(columns, signs, strict=True)]


def _read_column(cells: list[str], sign: str) -> tuple[list[float], str]:
    values = [_number(cell, sign) for cell in cells]
    rest = [(k, m) for k, cell in enumerate(cells) if math.isnan(values[k]) and (m := _unit_behind(cell))]
    unit, count = Counter(match[2] for _, match in rest).most_common(1)[0] if rest else ("", 0)
    if count < MIN_UNIT_SHARE * sum(map(bool, cells)):
        return values, ""
    for k, match in rest:
        if match[2] == unit:
            values[k] = _number(match[1], sign)
    return values, unit


def decimal_sign(cells: list[str]) -> str:
    """Return the decimal sign that the cells show, "." or ","; empty if they show none.

    Three digits behind a single sign may be thousands. They are, if smaller integers are without it.
    """
    votes: Counter[str] = Counter()
    grouped: Counter[str] = Counter()
    digits = [0]
    for cell in cells:
        signs = [letter for letter in cell if letter in ".,"]
        if ":" in cell:
            continue
        if not signs:
            digits += [len(match[1])] if (match := INTEGER.fullmatch(cell)) else []
        elif AMBIGUOUS.fullmatch(cell):
            grouped[signs[0]] += 1
        else:  # the last of two kinds; one that comes several times is none
            votes[signs[-1] if len(set(signs)) == 2 or len(signs) == 1 else _other(signs[0])] += 1
        if votes.total() == ENOUGH_VOTES:
            break
    if votes:
        return votes.most_common(1)[0][0]
    return _other(next(iter(grouped))) if grouped and 0 < max(digits) < 4 else ""


def to_number(text: str) -> float:
    """Return the number of one cell by either decimal sign, also with a unit behind it; else NaN.

    It only shows that the cell is a number: without the other cells, `1.234` may be 1234.
    """
    match = _unit_behind(plain(text))
    return _number(match[1] if match else plain(text), decimal_sign([text]))


def is_bare_number(text: str) -> bool:
    """Return whether a cell is a number, a date or a time of day, with nothing behind it."""
    return math.isfinite(_number(plain(text), decimal_sign([text])))


def plain(text: str) -> str:
    """Return the text with ASCII minus signs, and without blanks or apostrophes between thousands."""
    text = text.strip()
    if text.isascii() and "'" not in text and " " not in text:
        return text
    return GROUPS_OF_BLANKS.sub("", text.translate(PLAIN).strip())


def _unit_behind(text: str) -> re.Match[str] | None:
    return UNIT_BEHIND.fullmatch(text)


def _number(text: str, sign: str) -> float:
    """Return the number; without a decimal sign, any sign is one."""
    if ":" in text:
        return _clock_s(text)
    if sign and (other := _other(sign)) in text:
        if not THOUSANDS.fullmatch(text):
            return math.nan
        text = text.replace(other, "")
    try:
        return float(text.replace(",", "."))
    except ValueError:
        return math.nan


def _other(sign: str) -> str:
    return "," if sign == "." else "."


def _clock_s(text: str) -> float:
    """Return the seconds of a time of day, `h:m:s` or `m:s`, also with a date before it.

    Only differences count: time zones are not read, and `3/1` is taken as March.
    """
    match = CLOCK.fullmatch(text)
    if match is None:
        return math.nan
    first, second, third, hours, minutes, seconds, half = match.groups()
    hour = int(hours or 0)
    if half:
        hour = hour % 12 + (12 if half in "pP" else 0)
    of_day_s = 3600.0 * hour + 60.0 * int(minutes) + float(seconds.replace(",", "."))
    if first is None:
        return of_day_s
    year, month, day = int(first), int(second), int(third)
    if year <= 31:
        year, month, day = day, year, month
        if month > 12 or "." in text.split(maxsplit=1)[0]:
            month, day = day, month
    try:
        return 86400.0 * (date(max(year, 1), month, day) - date(1970, 1, 1)).days + of_day_s
    except ValueError:
        return math.nan
