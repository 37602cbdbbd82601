"""Run five simulated minutes of the soak test; `make soak` runs for hours."""

from threading import Event

import pytest

from thumper.runtime.service.stall_guard import STALL_S
from thumper_hil.bench import soak_drive
from thumper_hil.bench.soak import soak
from thumper_hil.bench.soak_drive import SoakDriver


@pytest.mark.slow
def test_robot_recovers_from_all_faults() -> None:
    report = soak(300.0, seed=2)
    assert report.failures == []  # memory, handles and recordings, too
    assert report.drives >= 15
    assert report.restarts >= 2
    assert report.growth()["handles"] <= 0.05
    assert report.required_reached == report.required >= 3
    assert sum(report.faults.values()) >= 2
    assert report.contacts == 0


@pytest.mark.slow
def test_unexpected_stop_is_reported_as_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    """A dead motor is treated as a tolerated fault; drives without a fault still reach their goals."""
    monkeypatch.setattr(soak_drive, "FAULTS", (("motor.left", "dead", "ok"),))
    monkeypatch.setattr(soak_drive, "TOLERATED", {"motor.left"})
    report = soak(40.0, seed=1)
    assert report.faults["motor.left"] > 0
    assert len(report.failures) == report.faults["motor.left"] == report.required - report.required_reached
    assert all("motor.left, is failed: the board stopped the motors" in one for one in report.failures)


@pytest.mark.slow
def test_stalled_computer_is_not_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    """The robot refuses requests that waited while it hung and asks to repeat them; the soak test does."""
    drive = SoakDriver.drive

    def drive_and_stall(driver: SoakDriver) -> None:
        drive(driver)
        Event().wait(STALL_S + 0.2)

    monkeypatch.setattr(SoakDriver, "drive", drive_and_stall)
    report = soak(20.0, seed=2)
    assert report.failures == []
    assert report.drives >= 2
