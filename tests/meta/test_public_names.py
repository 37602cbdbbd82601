"""What scripts import from `thumper`, and that type checkers see its types."""

from importlib.resources import files

import pytest

import thumper
from thumper.common.geometry import Pose2
from thumper.robot import Robot
from thumper.runtime.drive_result import DriveResult


def test_each_public_name_is_there() -> None:
    assert (thumper.Robot, thumper.Pose2, thumper.DriveResult) == (Robot, Pose2, DriveResult)
    assert all(hasattr(thumper, name) for name in thumper.__all__)
    with pytest.raises(AttributeError, match="Pose3"):
        thumper.Pose3  # noqa: B018


def test_the_package_is_marked_as_typed() -> None:
    assert files("thumper").joinpath("py.typed").is_file()
