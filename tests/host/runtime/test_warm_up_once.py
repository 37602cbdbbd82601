import gc
from dataclasses import replace

import pytest

from thumper.config.robot import RobotConfig, with_ports
from thumper.navigation.footprint import Footprint
from thumper.navigation.options import NavigationOptions
from thumper.runtime import assembly


def test_robots_with_the_same_options_warm_up_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A campaign opens hundreds of robots in one process."""
    warmed: list[NavigationOptions] = []

    def note(options: NavigationOptions, footprint: Footprint) -> None:
        del footprint
        warmed.append(options)

    monkeypatch.setattr(assembly, "warm_up_navigation", note)
    assembly._warm_up.cache_clear()
    config = RobotConfig()
    other = replace(config, navigation=replace(config.navigation, planner="navfn"))
    elsewhere = with_ports(config, board="sim://other/board", lidar="")
    assembly.warm_up(config)
    frozen = gc.get_freeze_count()
    for each in (elsewhere, other, config):
        assembly.warm_up(each)
    assert gc.get_freeze_count() <= frozen  # what is open by now can still be freed
    assembly._warm_up.cache_clear()  # without navigation, these do not count
    assert warmed == [config.navigation, other.navigation]
