"""A full disk: one line that names the file, earlier files whole, none half written; then it goes on."""

import resource
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from tests.fuzz.readers import GRID, write_grid, write_session
from tests.hil.campaign.samples import row
from thumper.common.errors import ThumperError
from thumper.common.files import write_csv, write_text
from thumper.maps.plot import plot_map
from thumper_hil.campaign.figures import draw
from thumper_hil.campaign.parquet import write_parquet
from thumper_hil.campaign.result_table import RowStore
from thumper_hil.campaign.summary import summarise
from thumper_tuning.calibration.wheel_log import COUNT_COLUMNS
from thumper_tuning.calibration.wheel_log import write_csv as write_wheel_log

ROWS = [row("a"), row("b")]
WRITERS: dict[str, Callable[[Path], object]] = {
    "map": write_grid,
    "session": write_session,
    "picture": lambda folder: plot_map(GRID, np.zeros((2, 2)), folder / "map.png", "map"),
    "text": lambda folder: write_text(folder / "summary.json", 500 * "x"),
    "csv": lambda folder: write_csv(folder / "path.csv", ["x_m", "y_m"], 90 * [(1.5, 2.5)]),
    "wheel_log": lambda folder: write_wheel_log(folder / "a.csv", COUNT_COLUMNS, np.ones((90, 3))),
    "parquet": lambda folder: write_parquet(folder / "rows.parquet", ROWS),
    "figure": lambda folder: draw(folder / "summary.png", ROWS, summarise(ROWS, ["time_s"])),
}


@contextmanager
def disk_full_after(size_bytes: int) -> Iterator[None]:
    """Let no file grow beyond this size: the kernel refuses the write, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS)
@pytest.mark.parametrize("room_bytes", [0, 10])
def test_a_full_disk_keeps_the_earlier_files(
    tmp_path: Path, write: Callable[[Path], object], room_bytes: int
) -> None:
    with disk_full_after(room_bytes), pytest.raises(ThumperError, match="free some space"):
        write(tmp_path)
    assert content(tmp_path) == {}
    write(tmp_path)
    before = content(tmp_path)
    with disk_full_after(room_bytes), pytest.raises(ThumperError, match="free some space") as caught:
        write(tmp_path)
    assert str(tmp_path) in str(caught.value)
    assert content(tmp_path) == before


@pytest.mark.parametrize("room_bytes", [0, 7])
def test_a_campaign_goes_on_when_there_is_room(tmp_path: Path, room_bytes: int) -> None:
    with disk_full_after(room_bytes), pytest.raises(ThumperError, match="free some space"):
        RowStore(tmp_path, "digest")
    with RowStore(tmp_path, "digest") as store:
        store.add(row("a"))
        before = content(tmp_path)
        with (
            disk_full_after(len(before["rows.csv"]) + room_bytes),
            pytest.raises(ThumperError, match=r"rows\.csv: cannot be written .*; free some space"),
        ):
            store.add(row("b"))
        assert content(tmp_path) == before
        store.add(row("c"))
    with RowStore(tmp_path, "digest") as store:
        assert [one.key for one in store.rows] == ["a", "c"]
