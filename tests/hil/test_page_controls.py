"""What a person may do to the simulated world while it runs."""

from typing import Any

import pytest

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper_hil.bench.bench import Bench
from thumper_hil.bench.options import BenchOptions
from thumper_hil.bench.page_controls import Controls


@pytest.fixture
def bench() -> Bench:
    return Bench(BenchOptions(world="hall"))


def ahead_m(bench: Bench) -> float:
    """How far the lidar's world is free in front of the robot."""
    pose = bench.chip.truth().map_from_base
    return float(bench.world.cast(pose.x_m, pose.y_m, [pose.theta_rad])[0])


def test_a_pillar_is_seen_from_the_robot_and_goes_again(bench: Bench) -> None:
    free_m = ahead_m(bench)
    bench.chip.place(Pose2(x_m=0.3, y_m=0.2, theta_rad=0.7))
    controls = Controls(bench)
    before_m = ahead_m(bench)
    controls.apply({"pillar": {"x_m": 1.0, "y_m": 0.0, "radius_m": 0.1}})
    assert ahead_m(bench) == pytest.approx(0.9, abs=1e-6)
    assert controls.describe()["pillars"] == 1
    controls.apply({"clear_pillars": True})
    assert ahead_m(bench) == before_m
    assert free_m > 1.0


def test_a_pillar_is_not_put_into_the_robot(bench: Bench) -> None:
    with pytest.raises(ThumperError, match="the robot stands there"):
        Controls(bench).apply({"pillar": {"x_m": 0.1, "y_m": 0.0, "radius_m": 0.1}})
    assert bench.contacts == 0


def test_a_fault_is_done_and_mended(bench: Bench) -> None:
    controls = Controls(bench)
    assert controls.describe()["faults"]["lidar"] == {"choices": ["ok", "unplugged"]}
    controls.apply({"fault": "lidar", "value": "unplugged"})
    assert not bench.is_plugged("lidar")
    controls.apply({"fault": "lidar", "value": "ok"})
    assert bench.is_plugged("lidar")


def test_what_is_wrong_is_told_until_it_is_mended(bench: Bench) -> None:
    controls = Controls(bench)
    told: list[dict[str, Any]] = []
    for name, value in (
        ("slip.left", 0.5),
        ("motor.left", "dead"),
        ("battery.charge", 0.0),
        ("robot.carried", [0.1, 0.0, 10.0]),  # once, and over
        ("host.hang", 0.1),
        ("firmware", "reset"),
        ("motor.left", "ok"),
        ("slip.left", 0.0),
    ):
        controls.apply({"fault": name, "value": value})
        told.append(controls.describe()["on"])
    assert told[1] == {"slip.left": 0.5, "motor.left": "dead"}
    assert told[5] == told[2] == {**told[1], "battery.charge": 0.0}
    assert told[-1] == {"battery.charge": 0.0}


@pytest.mark.parametrize(
    "content",
    [
        {},
        {"fault": "lidar"},
        {"fault": "no such", "value": "ok"},
        {"fault": "lidar", "value": "on fire"},
        {"pillar": {"x_m": 1.0, "y_m": 0.0}},
        {"pillar": {"x_m": 1.0, "y_m": float("nan"), "radius_m": 0.1}},
        {"pillar": {"x_m": 1.0, "y_m": 0.0, "radius_m": 100.0}},
        {"pillar": {"x_m": 1e9, "y_m": 0.0, "radius_m": 0.1}},
        {"clear_pillars": True, "more": 1},
        {"clear_pillars": "yes"},
    ],
)
def test_what_makes_no_sense_is_refused(bench: Bench, content: dict[str, Any]) -> None:
    with pytest.raises(ThumperError):
        Controls(bench).apply(content)
    assert bench.pillars == 0
