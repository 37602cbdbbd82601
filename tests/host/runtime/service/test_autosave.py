"""The session is saved every few seconds, in a thread, and a failure is reported once."""

import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from benchmarks.shared.telemetry import telemetry_sample

from thumper.common.geometry import Pose2
from thumper.common.kinematics import DriveGeometry
from thumper.lidar.scan import Scan
from thumper.maps.annotations import Annotations
from thumper.runtime.service import autosave
from thumper.runtime.service.autosave import PERIOD_S, Autosave
from thumper.runtime.state_estimator import StateEstimator
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.saved_state import load_session

SIZE_M = 0.05
NONE = Annotations()


class Clock:
    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 0.0
        self.busy_s = 0.0  # the computing time of a save
        self._busy_before_s = 0.0
        times = SimpleNamespace(monotonic=lambda: self.now_s, thread_time=self._thread_time)
        monkeypatch.setattr(autosave, "time", times)

    def _thread_time(self) -> float:
        self._busy_before_s += self.busy_s
        return self._busy_before_s


def mapped(estimator: StateEstimator, k: int) -> None:
    """Map a scan of a round room."""
    estimator.add_telemetry(telemetry_sample(0.2 * k, left_count=0, right_count=0))
    estimator.add_scan(
        Scan(
            time_s=0.2 * k,
            ranges_m=np.full(200, 2.0),
            angle_min_rad=-2.0,
            angle_increment_rad=0.02,
            time_increment_s=0.0005,
        )
    )
    estimator.add_telemetry(telemetry_sample(0.2 * k + 0.1, left_count=0, right_count=0))


def make() -> StateEstimator:
    return StateEstimator(
        drive=DriveGeometry(), base_from_laser=Pose2(), mapper=GridMapper(base_from_laser=Pose2())
    )


def finish() -> None:
    for thread in threading.enumerate():
        if thread.name == "autosave":
            thread.join(20.0)


def test_it_saves_what_is_new_and_removes_the_file_at_a_regular_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock, path, estimator = Clock(monkeypatch), tmp_path / "a.session", make()
    saver = Autosave(estimator, lambda: NONE, path, lambda _: None)
    for k in range(4):
        mapped(estimator, k)
    saver.step()
    assert not path.exists()  # it is not time yet
    clock.now_s = PERIOD_S
    saver.step()
    finish()
    assert load_session(path, SIZE_M).counts.hits.sum() > 0
    path.unlink()
    clock.now_s += PERIOD_S
    saver.step()  # nothing is new
    finish()
    assert not path.exists()
    mapped(estimator, 4)
    saver.step()
    saver.close(remove=False)
    assert path.exists()
    saver.close(remove=True)
    assert not path.exists()


def test_a_full_disk_is_reported_once_and_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock, estimator, reports = Clock(monkeypatch), make(), list[str]()
    path = tmp_path / "gone" / "a.session"
    saver = Autosave(estimator, lambda: NONE, path, reports.append)
    for k in range(3):
        mapped(estimator, k)
        clock.now_s += PERIOD_S
        saver.step()
        finish()
    assert len(reports) == 1
    assert "the session is not saved" in reports[0]
    path.parent.mkdir()
    mapped(estimator, 3)
    clock.now_s += PERIOD_S
    saver.step()
    finish()
    assert path.exists()


@pytest.mark.parametrize(("busy_s", "period_s"), [(0.0, PERIOD_S), (1.0, 10.0)])
def test_a_large_map_is_saved_less_often(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, busy_s: float, period_s: float
) -> None:
    clock, estimator, path = Clock(monkeypatch), make(), tmp_path / "a.session"
    clock.busy_s = busy_s
    saver = Autosave(estimator, lambda: NONE, path, lambda _: None)
    for k, (now_s, is_due) in enumerate([(5.0, True), (4.9 + period_s, False), (5.1 + period_s, True)]):
        path.unlink(missing_ok=True)
        mapped(estimator, k)
        clock.now_s = now_s
        saver.step()
        finish()
        assert path.exists() == is_due
