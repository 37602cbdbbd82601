"""A drive starts only with drained ports and mapped scans; a lidar without usable scans ends the wait."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from thumper.common.errors import ThumperError
from thumper.runtime.drive.start_gate import StartGate


class Inputs:
    """What the gate reads of the inputs."""

    def __init__(self, *, is_outdated: bool = False, is_current: bool = True, has_map: bool = True) -> None:
        self.is_outdated, self.is_current, self.has_map = is_outdated, is_current, has_map
        self.time_s: float | None = 0.0
        self.estimator = SimpleNamespace(state=self._state)

    def _state(self) -> Any:
        return None if self.time_s is None else SimpleNamespace(time_s=self.time_s)


def gate(inputs: Inputs) -> StartGate:
    return StartGate(cast("Any", inputs))


def test_open_at_once_with_a_map_and_recent_data() -> None:
    assert gate(Inputs()).is_open()


def test_after_a_pause_one_cycle_drains_the_ports() -> None:
    waits = gate(Inputs(is_outdated=True))
    assert [waits.is_open() for _ in range(3)] == [False, True, True]


def test_lidar_that_stays_old_delays_the_start_by_ten_cycles_only() -> None:
    waits = gate(Inputs(is_outdated=True, is_current=False))
    assert [waits.is_open() for _ in range(12)] == [False] * 10 + [True] * 2


def test_closed_until_the_first_scans_are_mapped() -> None:
    inputs = Inputs(has_map=False)
    inputs.time_s = None  # no odometry yet
    waits = gate(inputs)
    assert not waits.is_open()
    inputs.time_s = 3.0
    assert not waits.is_open()
    inputs.time_s = 8.0
    assert not waits.is_open()  # 5 s after the first stamp, not longer
    inputs.has_map = True
    assert waits.is_open()


def test_lidar_without_usable_scans_is_an_error_after_five_seconds() -> None:
    inputs = Inputs(has_map=False)
    waits = gate(inputs)
    for inputs.time_s in (0.0, 2.5, 5.0):
        assert not waits.is_open()
    inputs.time_s = 5.1
    with pytest.raises(ThumperError, match="no scans that match"):
        waits.is_open()
