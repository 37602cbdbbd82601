"""Give way: the best plan among predicted people."""

from dataclasses import replace
from functools import cache

import numpy as np

from tests.host.navigation.safety.test_escape import request
from thumper.common.geometry import FloatArray, Twist2
from thumper.navigation.controllers.controller import ControlRequest
from thumper.navigation.footprint import Footprint
from thumper.navigation.safety.give_way import GiveWay
from thumper.navigation.safety.tracks import STEP_S, STEPS
from thumper.navigation.speed_limits import SpeedLimits

FORWARD = Twist2(v_m_s=0.3)
PATH_M = np.column_stack((np.linspace(0.0, 1.8, 19), np.zeros(19)))


@cache
def asked() -> ControlRequest:
    free = request(np.empty((0, 2)))
    return replace(free, twist=FORWARD, last_command=FORWARD, v_limit_m_s=0.4, path_m=PATH_M)


def person(x_m: float, y_m: float, vx_m_s: float = 0.0, vy_m_s: float = 0.0) -> FloatArray:
    times_s = STEP_S * np.arange(1, STEPS + 1)
    return np.column_stack((x_m + vx_m_s * times_s, y_m + vy_m_s * times_s, np.full(STEPS, 0.2)))[:, None]


def give_way() -> GiveWay:
    return GiveWay(SpeedLimits(), Footprint(), margin_m=0.12)


def test_a_command_is_in_conflict_only_with_somebody_in_its_way() -> None:
    for way, expected in ((person(2.5, 0.0, -1.0), True), (person(2.5, 1.0, -1.0), False)):
        assert give_way().is_in_conflict(FORWARD, asked(), way) is expected
    assert not give_way().is_in_conflict(FORWARD, asked(), person(2.5, 0.0)[:, :0])


def test_a_slow_command_is_in_conflict_if_the_path_at_full_speed_is() -> None:
    slow, comes = Twist2(v_m_s=0.04), person(4.6, 0.0, -1.0)
    assert give_way().is_in_conflict(slow, asked(), comes)
    aside = replace(asked(), path_m=PATH_M + np.array((0.0, 1.0)))
    assert not give_way().is_in_conflict(slow, aside, comes)


def test_steps_aside_to_the_side_with_room() -> None:
    for side in (0.12, -0.12):
        command = give_way().best_command(asked(), person(3.0, side, -1.0), lambda wanted: wanted)
        assert command.v_m_s > 0.0
        assert command.w_rad_s * side < 0.0


def test_lets_somebody_pass_who_crosses() -> None:
    command = give_way().best_command(asked(), person(0.6, -0.9, 0.0, 0.7), lambda wanted: wanted)
    assert command.v_m_s <= 0.0


def test_stops_if_nothing_is_allowed() -> None:
    assert give_way().best_command(asked(), person(2.5, 0.1, -1.0), lambda _: None) == Twist2()
