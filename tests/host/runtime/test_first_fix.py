"""A robot that waits for its first GPS fix says so, and when it stops waiting."""

from itertools import count
from types import SimpleNamespace
from typing import Any

import pytest

from thumper.gps.fix import FixStatus
from thumper.runtime.assembly import wait_for_fix


@pytest.mark.parametrize(
    ("fix", "printed"),
    [
        (SimpleNamespace(status=FixStatus.GPS), 1),
        (SimpleNamespace(status=FixStatus.NONE), 2),
        (None, 2),
    ],
)
def test_the_wait_is_announced_and_its_end_without_a_fix(
    fix: Any, printed: int, capsys: pytest.CaptureFixture[str]
) -> None:
    times_s = count(0, 20)
    nothing = SimpleNamespace(poll=lambda *_: [])
    inputs: Any = SimpleNamespace(
        has_gps=True,
        keep_log=True,
        now_s=lambda: next(times_s),
        board=nothing,
        lidar=nothing,
        add_telemetry=lambda _: None,
        estimator=SimpleNamespace(fix=fix),
    )
    wait_for_fix(SimpleNamespace(inputs=inputs))  # type: ignore[arg-type]
    lines = capsys.readouterr().err.splitlines()
    assert (
        lines
        == [
            "waiting for the first GPS fix, at most 60 s",
            "no GPS fix: searching the whole map for the pose",
        ][:printed]
    )
    assert inputs.keep_log
