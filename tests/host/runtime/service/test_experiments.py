"""Experiments as the robot's loop sees them; what they drive is tested with the tuning."""

import threading
from pathlib import Path

import pytest

from thumper.board.board import Board, TelemetrySample
from thumper.runtime.service.experiments import Experiments


def test_who_stops_one_does_not_wait_for_what_it_works_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    may_end, worked_out = threading.Event(), threading.Event()

    def work(_name: str) -> None:
        may_end.wait(20.0)
        worked_out.set()

    monkeypatch.setattr("thumper.runtime.service.experiments._load", work)
    board = Board.open("sim://thinking/board", baud=500_000)
    experiments = Experiments()
    experiments.request({"name": "tune", "lane_m": 1.2}, "me")

    def on_cycle(_samples: list[TelemetrySample]) -> None:
        experiments.stop("cancelled")

    ending = experiments.run(board, on_cycle)
    try:
        assert (ending, worked_out.is_set()) == ("tune: cancelled", False)
    finally:
        may_end.set()
        board.close()
