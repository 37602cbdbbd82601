"""Two simulated minutes of the soak; `make soak` runs for hours."""

from threading import Event
from typing import Any

import pytest

from thumper.runtime.service.stall_guard import STALL_S
from thumper_hil.bench import soak as module
from thumper_hil.bench.soak import soak


def test_robot_recovers_from_all_faults() -> None:
    report = soak(120.0, seed=2)
    assert report.complaints == []
    assert report.drives >= 6
    assert report.owed_reached == report.owed >= 3
    assert sum(report.faults.values()) >= 2
    assert report.contacts == 0


def test_unexpected_stop_is_reported_as_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    """A dead motor, taken for a fault that the robot drives on through; drives without one still arrive."""
    monkeypatch.setattr(module, "FAULTS", (("motor.left", "dead", "ok"),))
    monkeypatch.setattr(module, "DRIVES_ON", {"motor.left"})
    report = soak(40.0, seed=1)
    assert report.faults["motor.left"] > 0
    assert len(report.complaints) == report.faults["motor.left"] == report.owed - report.owed_reached
    assert all("motor.left, is failed: the board stopped the motors" in one for one in report.complaints)


def test_stalled_computer_is_not_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    """The robot does nothing late that was asked while it hung, and says to ask again; so the soak does."""
    drive = module._one_drive

    def drive_and_stall(*arguments: Any) -> None:
        drive(*arguments)
        Event().wait(STALL_S + 0.2)

    monkeypatch.setattr(module, "_one_drive", drive_and_stall)
    report = soak(20.0, seed=2)
    assert report.complaints == []
    assert report.drives >= 2
