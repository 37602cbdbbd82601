"""A recording at a waypoint, and one that is under way."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from thumper.runtime.service.recorded_wait import recorded_wait


@pytest.mark.parametrize("is_recording", [False, True])
def test_a_recording_that_is_under_way_goes_on(*, is_recording: bool) -> None:
    commands: list[str] = []

    def run(name: str) -> str:
        commands.append(name)
        return name

    with recorded_wait(cast("Any", SimpleNamespace(is_recording=is_recording)), run):
        assert commands == ([] if is_recording else ["record_start"])
    assert commands == ([] if is_recording else ["record_start", "record_stop"])
