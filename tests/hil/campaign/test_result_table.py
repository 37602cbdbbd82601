"""Stored rows after a kill, and folders that belong to another campaign or process."""

import math
from pathlib import Path

import pytest

from tests.hil.campaign.samples import row
from thumper.common.errors import ThumperError
from thumper_hil.campaign.result_table import RowStore


def test_rows_survive_a_kill_without_duplicates(tmp_path: Path) -> None:
    with RowStore(tmp_path, "d") as store:
        store.add(row("a"))
        store.add(row("b", goal_error_m=math.nan))
    whole = (tmp_path / "rows.csv").read_bytes()
    for cut in range(whole.index(b"\na,") + 1, len(whole), 5):
        (tmp_path / "rows.csv").write_bytes(whole[:cut])
        with RowStore(tmp_path, "d") as store:
            keys = [r.key for r in store.rows]
            assert keys in (["a"], [])
            store.add(row("c"))
        with RowStore(tmp_path, "d") as store:
            assert [r.key for r in store.rows] == [*keys, "c"]


def test_folder_of_another_campaign_is_refused(tmp_path: Path) -> None:
    with RowStore(tmp_path, "d"):
        pass
    with pytest.raises(ThumperError, match="another campaign"):
        RowStore(tmp_path, "e")


def test_second_process_in_the_same_folder_is_refused(tmp_path: Path) -> None:
    with RowStore(tmp_path, "d") as store:
        with pytest.raises(ThumperError, match="is writing to this folder") as caught:
            RowStore(tmp_path, "d")
        store.add(row("a"))
    assert caught.value.exit_code == 2
    with RowStore(tmp_path, "d") as store:
        assert [r.key for r in store.rows] == ["a"]


def test_rows_with_wrong_columns_are_refused(tmp_path: Path) -> None:
    (tmp_path / "rows.csv").write_text("key,mission\na,b\n")
    with pytest.raises(ThumperError, match="not the rows"):
        RowStore(tmp_path, "d")
