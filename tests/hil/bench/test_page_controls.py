"""Test the dashboard's commands to a running simulation."""

from typing import Any

import pytest

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.dashboard.guide.robot_file import WORLDS as SETUP_WORLDS
from thumper.runtime.service.simulator_control import SimulatorControl
from thumper_hil.bench.bench import Bench
from thumper_hil.bench.options import BenchOptions
from thumper_hil.bench.page_controls import PageControls
from thumper_hil.world.world_file import TITLES, world_names


@pytest.fixture
def bench() -> Bench:
    return Bench(BenchOptions(world="hall"))


def ahead_m(bench: Bench) -> float:
    """Return the free distance in front of the robot [m]."""
    pose = bench.chip.truth().map_from_base
    return float(bench.world.cast(pose.x_m, pose.y_m, [pose.theta_rad])[0])


def test_pillar_is_added_and_removed(bench: Bench) -> None:
    free_m = ahead_m(bench)
    bench.chip.place(Pose2(x_m=0.3, y_m=0.2, theta_rad=0.7))
    controls = PageControls(bench)
    before_m = ahead_m(bench)
    controls.apply({"pillar": {"x_m": 1.0, "y_m": 0.0, "radius_m": 0.1}})
    assert ahead_m(bench) == pytest.approx(0.9, abs=1e-6)
    description = controls.describe()
    assert description["pillars"] == 1
    assert all(fault["effect"].endswith(".") for fault in description["faults"].values())
    titles = [fault["title"] for fault in description["faults"].values()]
    assert len(set(titles)) == len(titles)
    assert "Left encoder: wire A" in titles
    assert set(TITLES) == set(world_names())
    assert list(description["titles"]) == description["worlds"]
    for label, place in SETUP_WORLDS.items():  # the setup has the same names
        assert description["titles"][place.partition("&")[0]] == label
    lasting = {name for name, fault in description["faults"].items() if "normal" in fault}
    assert "slip.left" in lasting
    assert not {"host.hang", "battery.charge", "robot.carried"} & lasting
    controls.apply({"clear_pillars": True})
    assert ahead_m(bench) == before_m
    assert free_m > 1.0


def test_pillar_that_overlaps_the_robot_is_refused(bench: Bench) -> None:
    with pytest.raises(ThumperError, match="would overlap the robot"):
        PageControls(bench).apply({"pillar": {"x_m": 0.1, "y_m": 0.0, "radius_m": 0.1}})
    assert bench.contacts == 0


def test_fault_is_set_and_cleared(bench: Bench) -> None:
    controls = PageControls(bench)
    assert controls.describe()["faults"]["lidar"]["choices"] == ["ok", "unplugged"]
    assert controls.apply({"fault": "lidar", "value": "unplugged"}) == "Lidar: plug: unplugged"
    assert not bench.is_plugged("lidar")
    controls.apply({"fault": "lidar", "value": "ok"})
    assert bench.is_plugged("lidar")


def test_active_faults_are_listed_until_cleared(bench: Bench) -> None:
    controls = PageControls(bench)
    active: list[dict[str, Any]] = []
    for name, value in (
        ("slip.left", 0.5),
        ("motor.left", "dead"),
        ("battery.charge", 0.0),
        ("robot.carried", [0.1, 0.0, 10.0]),  # a single event
        ("host.hang", 0.1),
        ("firmware", "reset"),
        ("motor.left", "ok"),
        ("slip.left", 0.0),
    ):
        controls.apply({"fault": name, "value": value})
        active.append(controls.describe()["on"])
    assert active[1] == {"slip.left": 0.5, "motor.left": "dead"}
    assert active[5] == active[2] == {**active[1], "battery.charge": 0.0}
    assert active[-1] == {"battery.charge": 0.0}


def test_all_faults_are_removed_at_once(bench: Bench) -> None:
    controls = PageControls(bench)
    full_V = bench.chip.truth().battery_V
    faults = {
        "lidar": "unplugged",
        "slip.left": 0.5,
        "motor.right": "swapped",
        "battery.charge": 0.0,
        "battery.resistance": 5.0,
    }
    for name, value in faults.items():
        controls.apply({"fault": name, "value": value})
    assert controls.describe()["on"] == faults
    assert controls.apply({"clear_faults": True}) == "removed all faults"
    assert controls.describe()["on"] == {}
    assert bench.is_plugged("lidar")
    bench.advance(bench.time_s + 0.1)
    assert bench.chip.truth().battery_V == pytest.approx(full_V, abs=0.05)


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
        {"clear_faults": False},
    ],
)
def test_invalid_command_is_refused(bench: Bench, content: dict[str, Any]) -> None:
    with pytest.raises(ThumperError):
        PageControls(bench).apply(content)
    assert bench.pillars == 0


def test_a_restart_names_the_world_by_its_title(bench: Bench) -> None:
    control = SimulatorControl(PageControls(bench))
    control.can_restart = True
    assert control.apply({"world": "lab"}) == "the robot starts again in the world Laboratory, with a new map"
    assert control.next_world == "lab"
