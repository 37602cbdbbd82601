"""Each beam uses the world at its own time: a wall approaches during a revolution of the lidar."""

import numpy as np
import pytest

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.scip import parse_reply, parse_scan
from thumper_hil.lidars.urg04lx import FIRST_STEP, LAST_STEP, STEPS_PER_TURN, TURN_S, Urg04Lx
from thumper_hil.lidars.urg_noise import RANGE_MIN_MM
from thumper_hil.world.echoes import WorldAt
from thumper_hil.world.world import World
from thumper_hil.world.world_history import WorldHistory

TICK_S = 0.01
SPEED_M_S = 3.0


def room(radius_m: float) -> World:
    """Return a circular room; every ray from its centre has the length of the radius."""
    return World(segments_m=np.zeros((0, 4)), circles_m=np.array([[0.0, 0.0, radius_m]]))


def shrinking(seconds: float) -> WorldHistory:
    """Return a circular room of 4 m whose wall approaches at 3 m/s."""
    worlds = WorldHistory(room(4.0))
    for tick in range(1, round(seconds / TICK_S) + 1):
        worlds.append(room(4.0 - SPEED_M_S * tick * TICK_S), tick * TICK_S)
    return worlds


def test_ray_uses_the_world_of_its_time() -> None:
    times_s = np.linspace(0.05, 0.24, 40)
    nothing = np.zeros_like(times_s)
    ranges_m = shrinking(0.25).cast_at(times_s, nothing, nothing, np.linspace(-2.0, 2.0, 40))
    error_m = ranges_m - (4.0 - SPEED_M_S * times_s)
    assert np.abs(error_m).max() <= 0.5 * TICK_S * SPEED_M_S + 1e-9
    assert np.abs(error_m.mean()) < 0.1 * TICK_S * SPEED_M_S  # errors in both directions cancel


def test_older_times_use_the_oldest_known_world() -> None:
    worlds = shrinking(0.5)
    oldest_m = worlds.cast_at(np.array([0.0]), np.zeros(1), np.zeros(1), np.zeros(1))
    assert oldest_m == pytest.approx([4.0 - SPEED_M_S * 0.19], abs=1e-9)


def scan_mm(world: WorldAt) -> FloatArray:
    """Return steps 44...725 of the first scan requested at 0.1 s."""
    device = Urg04Lx(world=world, pose_at=lambda t: np.zeros((t.size, 3)), base_from_laser=Pose2(), seed=3)
    device.advance(0.1)
    device.write(b"MD0044072501001\n", 0.1)
    device.advance(0.4)
    reply = device.read().split(b"\n\n")[-2]
    return parse_scan(parse_reply(reply)).values_mm.astype(np.float64)


def slope_mm(world: WorldAt) -> float:
    """Return the growth of the ranges of a scan per step."""
    values_mm = scan_mm(world)
    seen = values_mm >= RANGE_MIN_MM
    return float(np.polyfit(np.arange(FIRST_STEP, LAST_STEP + 1)[seen], values_mm[seen], 1)[0])


def test_scan_of_a_moving_wall_is_a_spiral() -> None:
    """In the 66.6 ms from step 44 to 725 a wall at 3 m/s approaches by 0.2 m."""
    expected_mm = -1e3 * SPEED_M_S * TURN_S / STEPS_PER_TURN
    assert slope_mm(shrinking(0.3)) - slope_mm(room(3.6)) == pytest.approx(expected_mm, rel=0.15)
