"""A real log damaged in many ways: each gives the right map, or one line that says what is wrong."""

import os
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray
from thumper.offline.map_log import MapLogSummary, map_log
from thumper.offline.metrics import load_relations, relation_errors
from thumper.slam.factory import MappingOptions

DATA = Path(os.environ.get("THUMPER_DATA", Path(__file__).parents[4] / "shared" / "data")) / "slam"
INTEL = DATA / "intel-lab.clf.gz"
SCANS = 900

pytestmark = pytest.mark.skipif(not INTEL.exists(), reason=f"no {INTEL}; set THUMPER_DATA")

Rows = list[list[str]]


@cache
def rows() -> Rows:
    """Return the fields of the first laser lines: FLASER 180 r1...r180 laser odometry stamp host stamp."""
    import gzip

    with gzip.open(INTEL, "rt") as stream:
        lines = [line.split() for line in stream if line.startswith("FLASER")]
    return lines[:SCANS]


def edited(edit: Callable[[int, list[str]], list[str]]) -> Rows:
    return [edit(number, list(row)) for number, row in enumerate(rows())]


def ranges(row: list[str], change: Callable[[FloatArray], FloatArray]) -> list[str]:
    changed = change(np.array(row[2:182], dtype=np.float64))
    return ["FLASER", str(len(changed)), *(f"{value:.3f}" for value in changed), *row[182:]]


def without_odometry(_: int, row: list[str]) -> list[str]:
    return [*row[:182], *6 * ["0.0"], *row[188:]]


def with_nan(number: int, row: list[str]) -> list[str]:
    rng = np.random.default_rng(number)
    return ranges(row, lambda r: np.where(rng.random(180) < 0.2, np.nan, r))


RIGHT: dict[str, tuple[Callable[[], Rows], str]] = {  # what is changed -> the rows, and what the notes say
    "as it is": (rows, ""),
    "last line cut off": (lambda: [*rows()[:-1], rows()[-1][:90]], "1 broken lines dropped"),
    "a fifth of the ranges NaN": (lambda: edited(with_nan), ""),
    "each line twice": (
        lambda: [row for row in rows() for _ in range(2)],
        "with the stamp of the previous scan; is each scan sent twice",
    ),
    "backwards": (lambda: rows()[::-1], "stamped before the previous scan"),
    "zeros for no return": (
        lambda: edited(lambda _, row: ranges(row, lambda r: np.where(r > 80.0, 0.0, r))),
        "",
    ),
    "every second beam": (
        lambda: edited(lambda _, row: ranges(row, lambda r: r[::2])),
        "90 beams without a field of view: 180 degrees assumed",
    ),
    "some scans with other beams": (
        lambda: edited(lambda k, row: ranges(row, lambda r: r[::2]) if k % 7 == 3 else row),
        "",
    ),
    "no odometry": (lambda: edited(without_odometry), "no odometry that moves"),
}
REFUSED: dict[str, tuple[Callable[[], Rows], str]] = {  # what is changed -> the rows, and the one line
    "millimetres": (
        lambda: edited(lambda _, row: ranges(row, lambda r: 1000.0 * r)),
        "in millimetres",
    ),
    "odometry in millimetres": (
        lambda: edited(
            lambda _, row: [*row[:185], *(str(1000.0 * float(x)) for x in row[185:187]), *row[187:]]
        ),
        "odometry is in millimetres.*--mount millimetres",
    ),
    "heading in degrees": (
        lambda: edited(lambda _, row: [*row[:187], str(np.degrees(float(row[187]))), *row[188:]]),
        "in degrees.*--mount degrees",
    ),
    "no beam": (
        lambda: edited(lambda _, row: ranges(row, lambda r: np.full(180, np.nan))),
        "nothing to map",
    ),
    "half of the lines damaged": (
        lambda: edited(lambda k, row: row[:50] if k % 2 else row),
        "line 2: broken FLASER",
    ),
}


def written(path: Path, lines: Rows) -> Path:
    path.write_text("\n".join(" ".join(row) for row in lines) + "\n")
    return path


def mapped(path: Path, out: Path) -> MapLogSummary:
    return map_log(path, out, options=MappingOptions(method="scan_match"))


@pytest.mark.parametrize("what", RIGHT)
def test_a_damaged_log_gives_the_right_map(tmp_path: Path, what: str) -> None:
    make, note = RIGHT[what]
    lines = make()
    summary = mapped(written(tmp_path / "drive.log", lines), tmp_path / "out")
    assert any(note in line for line in summary.notes) or not note, summary.notes
    path = np.loadtxt(tmp_path / "out" / "trajectory.csv", delimiter=",", skiprows=1)[:, 1:]
    if len(path) == 2 * SCANS:
        path = path[::2]
    if what == "backwards":
        path = path[::-1]
    relations = load_relations(DATA / "intel-lab.relations-by-scan.gz")
    relations = relations[(relations[:, :2] < len(path)).all(axis=1)]
    assert len(relations) > 50
    errors = relation_errors(path, relations)
    assert 0.005 < errors.translation_m.mean() < 0.04, what
    assert errors.translation_m.max() < 0.4


@pytest.mark.parametrize("what", REFUSED)
def test_a_wrong_log_is_refused_in_one_line(tmp_path: Path, what: str) -> None:
    make, text = REFUSED[what]
    path = written(tmp_path / "drive.log", make())
    with pytest.raises(ThumperError, match=text) as error:
        mapped(path, tmp_path / "out")
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)
    assert not (tmp_path / "out" / "map.pgm").exists()
