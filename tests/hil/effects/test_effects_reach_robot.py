"""Every effect of the preset `hard` reaches the robot: without it, the host receives something else."""

from collections.abc import Iterator
from dataclasses import fields, replace
from functools import cache
from itertools import count
from pathlib import Path
from typing import Literal
from unittest.mock import patch

import numpy as np
import pytest

from thumper.board.board import Board
from thumper.board.messages import Command
from thumper.common.kinematics import WheelSpeeds
from thumper.lidar.open_lidar import open_lidar
from thumper.lidar.options import LidarOptions
from thumper_hil.bench import simulation
from thumper_hil.bench.registry import forget_simulation
from thumper_hil.effects.preset import Preset, load_preset

Model = Literal["urg04lx", "ld19"]
STATIONARY_S, DRIVE_S, STOP_S = 0.5, 1.2, 0.5
SIMULATED_S = replace(load_preset("hard").host, cpu_factor=0.0)  # or computing would make each run differ
HARD = replace(load_preset("hard"), host=SIMULATED_S)
OTHER = {"floor": "carpet", "grazing_deg": 90.0, "surfaces": False}  # 0 for all effects that are not here
ROOM = """
[[wall]]
points_m = [[-1.5, -0.6], [4.0, -0.6], [4.0, 0.6], [-1.5, 0.6]]
closed = true
[[box]]
x_m = 1.8
y_m = 0.4
length_m = 0.4
width_m = 0.3
surface = "dark"
"""
SILL = "[[sill]]\npoints_m = [[0.1, -0.6], [0.1, 0.6]]\nheight_m = 0.02\n"
names = map("reach-{}".format, count())


def effects() -> Iterator[tuple[str, str]]:
    """Yield part and name of all effects on the robot and its sensors."""
    for part in ("body", "mount", "clock", "lidar"):
        for field in fields(getattr(HARD, part)):
            yield part, field.name


def without(part: str, name: str) -> Preset:
    """Return the preset without one effect, or with another value of it."""
    changed = replace(getattr(HARD, part), **{name: OTHER.get(name, 0.0)})
    return replace(HARD, **{part: changed})


@cache
def received(preset: Preset, world: Path, lidar_model: Model) -> bytes:
    """Return what the host receives from a robot that drives over the sill and stops."""
    name = next(names)
    url = f"world={world}&lidar={lidar_model}&preset=hard&seed=17"
    with patch("thumper_hil.bench.bench.load_preset", lambda _: preset):
        board = Board.open(f"sim://{name}/board?{url}", baud=500_000)
    lidar = open_lidar(LidarOptions(port=f"sim://{name}/lidar", model=lidar_model))
    bench, told = simulation(name), []

    def listen(for_s: float, speed_rad_s: float = 0.0) -> None:
        until_s = bench.time_s + for_s
        while bench.time_s < until_s:
            if speed_rad_s:
                board.set_wheel_speeds(WheelSpeeds(left_rad_s=speed_rad_s, right_rad_s=0.8 * speed_rad_s))
            for sample in board.poll(0.005):
                row = sample.telemetry
                told.append(np.array([row.time_us, row.left_count, row.right_count], float).tobytes())
            for scan in lidar.poll():
                told.append(np.append(scan.ranges_m, (scan.time_s, bench.time_s)).tobytes())

    listen(STATIONARY_S)
    board.command(Command.ARM)
    listen(DRIVE_S, speed_rad_s=9.0)
    board.emergency_stop()
    listen(STOP_S)
    lidar.close()
    board.close()
    forget_simulation(name)
    return b"".join(told)


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a room with a sill and a dark box."""
    path = tmp_path_factory.mktemp("room") / "room.toml"
    path.write_text(ROOM + SILL)
    return path


@pytest.mark.parametrize("model", ["urg04lx", "ld19"])
def test_the_same_robot_sends_the_same(model: Model, room: Path) -> None:
    first = received(HARD, room, model)
    received.cache_clear()
    assert received(HARD, room, model) == first


@pytest.mark.parametrize("model", ["urg04lx", "ld19"])
@pytest.mark.parametrize(("part", "name"), list(effects()), ids=[".".join(effect) for effect in effects()])
def test_an_effect_reaches_the_robot(part: str, name: str, model: Model, room: Path) -> None:
    if (model, name) == ("urg04lx", "mixed_share"):
        pytest.skip("the simulated URG-04LX mixes pixels as in a recorded log, under every preset")
    assert received(without(part, name), room, model) != received(HARD, room, model)


@pytest.mark.parametrize("model", ["urg04lx", "ld19"])
def test_a_sill_pitches_the_lidar(model: Model, room: Path) -> None:
    level = room.with_name("level.toml")
    level.write_text(ROOM)
    assert received(HARD, level, model) != received(HARD, room, model)
