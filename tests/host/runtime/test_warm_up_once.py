from dataclasses import replace

import pytest

from thumper.config.robot import RobotConfig
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
    assembly.warm_up.cache_clear()
    config = RobotConfig()
    other = replace(config, navigation=replace(config.navigation, planner="navfn"))
    for each in (config, RobotConfig(), other, config):
        assembly.warm_up(each)
    assembly.warm_up.cache_clear()  # without navigation, these do not count
    assert warmed == [config.navigation, other.navigation]
