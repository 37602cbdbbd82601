"""What must hold before a request is carried out."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from thumper.common.errors import ThumperError
from thumper.runtime.drive.drive_manager import DriveMode
from thumper.runtime.service.preconditions import Preconditions


def conditions(
    mode: DriveMode = DriveMode.IDLE, experiment: str = "", requested: str = "", **others: Any
) -> Preconditions:
    return Preconditions(
        drive_manager=cast("Any", SimpleNamespace(mode=mode)),
        experiments=cast("Any", SimpleNamespace(running=experiment, requested=requested)),
        **others,
    )


def test_a_run_with_goals_of_its_own_refuses_those_of_clients() -> None:
    conditions().require_serving("goals")
    with pytest.raises(ThumperError, match="accepts goals"):
        conditions(accepts_goals=False).require_serving("goals")


def test_experiment_excludes_other_requests() -> None:
    conditions().require_no_experiment()
    with pytest.raises(ThumperError, match="step is running: cancel it first"):
        conditions(experiment="step").require_no_experiment()
    with pytest.raises(ThumperError, match="step is running: cancel it first"):
        conditions(requested="step").require_no_experiment()


@pytest.mark.parametrize("mode", DriveMode)
def test_moving_robot_refuses_what_needs_it_stationary(mode: DriveMode) -> None:
    if mode in (DriveMode.IDLE, DriveMode.HOLDING):
        conditions(mode).require_stationary("save")
    else:
        with pytest.raises(ThumperError, match="must be stationary to save"):
            conditions(mode).require_stationary("save")


@pytest.mark.parametrize("mode", DriveMode)
def test_experiment_needs_the_motors_off(mode: DriveMode) -> None:
    if mode is DriveMode.IDLE:
        conditions(mode).require_motors_off("an experiment")
    else:
        with pytest.raises(ThumperError, match="motors off"):
            conditions(mode).require_motors_off("an experiment")
