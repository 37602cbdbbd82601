"""A low battery ends the mission, and the robot drives home: the real firmware on the simulated chip."""

import importlib.util
import math
from collections.abc import Iterator
from contextlib import contextmanager
from unittest.mock import patch

import pytest

from tests.e2e.service import FAR, NEAR, START, Service
from thumper.camera.dock_options import DockOptions
from thumper.camera.options import CameraOptions
from thumper.common.geometry import Pose2
from thumper.config.robot import RobotConfig, with_ports
from thumper.maps.annotations import Annotations, SavedPlace
from thumper.runtime.assembly import open_robot
from thumper.runtime.requests import RobotCommand
from thumper_hil.bench import simulation

HOME = SavedPlace(name="Home", x_m=1.73, y_m=0.08)
LIMIT_V = 7.3  # with a charge of 8 % the battery falls below it
CHARGE = 0.08


@contextmanager
def robot(name: str, *places: SavedPlace, limit_V: float = LIMIT_V) -> Iterator[Service]:
    mission = f"world=lab&x_m={START.x_m}&y_m={START.y_m}&yaw_deg={math.degrees(START.theta_rad)}"
    config = RobotConfig(dock=DockOptions(low_battery_V=limit_V))
    config = with_ports(config, board=f"sim://{name}/board?{mission}", lidar=f"sim://{name}/lidar")
    with open_robot(config, START, annotations=Annotations(places=places)) as loop:
        service = Service(loop, simulation(name))
        with patch("time.monotonic", service.wall_s):
            loop.wait_for_map()
            yield service


def patrol(service: Service) -> int:
    """Start to drive to and fro; return the number of the mission."""
    goals = [{"x_m": goal.x_m, "y_m": goal.y_m} for goal in (NEAR, FAR)]
    mission = service.ask("mission/follow", {"goals": goals, "rounds": 20})["mission"]
    service.run_cycles(30)
    return int(mission)


def said(service: Service, text: str) -> bool:
    return any(text in event for event in service.events)


def test_a_low_battery_ends_the_mission_and_the_robot_drives_home() -> None:
    with robot("goes-home", HOME) as service:
        mission = patrol(service)
        assert service.mode == "driving"
        service.bench.fault("battery.charge", CHARGE)
        service.until(lambda: said(service, "driving to the place 'home'"), max_cycles=150)
        ended = service.ask("mission/state", {"mission": mission})
        assert ended["state"] == "failed"
        assert "the battery is low: 7." in ended["reason"]
        service.until(lambda: service.ask("mission/state")["state"] == "reached", max_cycles=400)
        at_m = service.bench.truth()[-1, 1:3]
        assert math.dist(at_m, (HOME.x_m, HOME.y_m)) < 0.15
        patrol(service)  # sent by somebody who knows
        service.run_cycles(100)
        assert service.mode == "driving"


@pytest.mark.slow
def test_who_stops_the_robot_then_is_obeyed() -> None:
    with robot("stays", HOME) as service:
        patrol(service)
        service.bench.fault("battery.charge", CHARGE)
        service.until(lambda: said(service, "driving to the place 'home'"), max_cycles=150)
        service.put(RobotCommand(name="cancel"))
        service.run_cycles(100)
        assert service.mode == "idle"


@pytest.mark.slow
def test_without_a_place_to_drive_to_the_mission_goes_on() -> None:
    with robot("homeless") as service:
        patrol(service)
        service.bench.fault("battery.charge", CHARGE)
        service.until(
            lambda: said(service, "the map has no place 'dock' or 'home' to drive to"), max_cycles=150
        )
        service.run_cycles(20)
        assert service.mode == "driving"


@pytest.mark.slow
def test_by_default_no_voltage_ends_a_mission() -> None:
    with robot("carefree", HOME, limit_V=DockOptions().low_battery_V) as service:
        patrol(service)
        service.bench.fault("battery.charge", CHARGE)
        service.run_cycles(150)
        assert service.mode == "driving"
        assert not said(service, "battery")


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("cv2") is None, reason="the extra `camera` is not installed")
def test_with_a_camera_it_docks() -> None:
    options = DockOptions(low_battery_V=LIMIT_V)
    dock = SavedPlace(name="dock", x_m=-1.595 + options.distance_m, y_m=0.0, yaw_rad=math.pi)
    config = RobotConfig(dock=options, camera=CameraOptions(enabled=True))
    board = "sim://low-dock/board?world=charging&x_m=-0.35&y_m=0.12&yaw_deg=170"
    config = with_ports(config, board=board, lidar="sim://low-dock/lidar")
    start = Pose2(x_m=-0.35, y_m=0.12, theta_rad=math.radians(170.0))
    with open_robot(config, start, annotations=Annotations(places=(dock, HOME))) as loop:
        service = Service(loop, simulation("low-dock"))
        with patch("time.monotonic", service.wall_s):
            loop.wait_for_map()
            patrol(service)
            service.bench.fault("battery.charge", CHARGE)
            service.until(lambda: said(service, "docked: "), max_cycles=1500)
            at_m = service.bench.truth()[-1, 1:3]
            assert math.dist(at_m, (dock.x_m, dock.y_m)) < 0.02
