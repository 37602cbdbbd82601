"""Tasks answer "what next?" after each leg."""

import pytest

from tests.host.runtime.drive.carry_out import carry_out
from thumper.common.errors import ThumperError
from thumper.navigation.goal import Goal
from thumper.runtime.drive.legs import AnyLeg
from thumper.runtime.drive.tasks import drive_to_goal
from thumper.runtime.drive_result import DriveResult


def refuse(_leg: AnyLeg) -> DriveResult:
    raise ThumperError("no telemetry")


def test_a_refused_only_leg_raises_the_refusal() -> None:
    with pytest.raises(ThumperError, match="no telemetry"):
        carry_out(drive_to_goal(Goal(x_m=1.0, y_m=0.0)), refuse)
