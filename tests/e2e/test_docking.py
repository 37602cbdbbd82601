"""A running robot docks by the tag: the real firmware, a rendered camera, a world with a dock."""

import importlib.util
import math
from collections.abc import Iterator
from contextlib import contextmanager
from unittest.mock import patch

import pytest

from tests.e2e.service import Service
from thumper.camera.dock_options import DockOptions
from thumper.camera.options import CameraOptions
from thumper.common.geometry import Pose2
from thumper.config.robot import RobotConfig, with_ports
from thumper.maps.annotations import Annotations, SavedPlace
from thumper.runtime.assembly import open_robot
from thumper.runtime.requests import RobotCommand
from thumper_hil.bench import simulation

if importlib.util.find_spec("cv2") is None:
    pytest.skip("the extra `camera` is not installed", allow_module_level=True)

START = Pose2(y_m=0.12, theta_rad=math.radians(175.0))  # the tag is in view
DOCKED = Pose2(x_m=-1.595 + DockOptions().distance_m, theta_rad=math.pi)


@contextmanager
def robot(
    name: str, start: Pose2 = START, *, places: tuple[SavedPlace, ...] = (), **dock: float
) -> Iterator[Service]:
    config = RobotConfig(camera=CameraOptions(enabled=True), dock=DockOptions(**dock))  # type: ignore[arg-type]
    mission = f"world=charging&x_m={start.x_m}&y_m={start.y_m}&yaw_deg={math.degrees(start.theta_rad)}"
    config = with_ports(config, board=f"sim://{name}/board?{mission}", lidar=f"sim://{name}/lidar")
    with open_robot(config, start, annotations=Annotations(places=places)) as loop:
        service = Service(loop, simulation(name))
        with patch("time.monotonic", service.wall_s):
            loop.wait_for_map()
            loop.request_handler.accepts_goals = True
            yield service


def place(service: Service) -> Pose2:
    _, x_m, y_m, theta_rad = service.bench.truth()[-1, :4].tolist()
    return DOCKED.inverse() @ Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)


def told(service: Service, text: str) -> int:
    return sum(event.startswith(text) for event in service.events)


def said(service: Service, text: str) -> bool:
    return told(service, text) > 0


@pytest.mark.parametrize(
    "start",
    [
        pytest.param(DOCKED @ Pose2(x_m=-DockOptions().staging_m), id="staging"),
        pytest.param(START, id="further back", marks=pytest.mark.slow),
    ],
)
def test_docks_and_undocks_with_the_motors_off_afterwards(start: Pose2) -> None:
    with robot("docks", start) as service:
        assert service.ask("command", {"command": "dock"})["text"] == "docking"
        service.until(lambda: said(service, "docked: ") or said(service, "not docked"), max_cycles=1500)
        service.until(lambda: service.mode == "idle")
        assert said(service, "docked: "), service.events
        at = place(service)
        assert math.hypot(at.x_m, at.y_m) < 0.01
        assert abs(math.degrees(at.theta_rad)) < 1.0
        service.put(RobotCommand(name="undock"))
        service.until(lambda: said(service, "undocked: "), max_cycles=300)
        service.until(lambda: service.mode == "idle")
        assert place(service).x_m == pytest.approx(-DockOptions().staging_m, abs=0.04)
        assert service.bench.contacts == 0


def test_near_the_dock_it_backs_off_only_if_it_faces_it() -> None:
    """The robot has its back to the dock: backing off would end in the wall."""
    dock = SavedPlace(name="dock", x_m=DOCKED.x_m, y_m=0.0, yaw_rad=math.pi)
    with robot("back-to-dock", DOCKED @ Pose2(x_m=-0.18, theta_rad=2.5), places=(dock,)) as service:
        service.put(RobotCommand(name="dock"))
        service.until(lambda: service.robot.drive_manager.activity == "to the dock", max_cycles=100)
        service.run_cycles(60)
        assert not said(service, "not docked"), service.events
        assert service.bench.contacts == 0


@pytest.mark.slow
def test_a_cancelled_approach_is_not_tried_again() -> None:
    with robot("cancelled-dock", staging_m=0.6) as service:
        service.put(RobotCommand(name="dock"))
        service.until(lambda: place(service).x_m > -0.5, max_cycles=600)
        service.put(RobotCommand(name="cancel"))
        service.until(lambda: said(service, "not docked: cancelled"), max_cycles=5)
        service.run_cycles(30)
        assert service.mode == "idle"
        assert -0.5 < place(service).x_m < -0.4


@pytest.mark.parametrize(("beside_m", "at_once"), [(0.12, True), (0.18, False)])
def test_near_the_staging_pose_it_approaches_at_once(beside_m: float, at_once: bool) -> None:
    """To drive 0.12 m to the side takes turns to and fro."""
    start = DOCKED @ Pose2(x_m=-0.1 - DockOptions().staging_m, y_m=beside_m)
    with robot(f"beside-staging-{beside_m:g}", start) as service:
        service.put(RobotCommand(name="dock"))
        tasks = set()
        while place(service).distance_m(DOCKED.inverse() @ start) < 0.05 and "to the dock" not in tasks:
            service.run_cycles(1)
            tasks.add(service.robot.drive_manager.activity)
        assert ("to the dock" not in tasks) == at_once


def test_cancelled_while_looking_it_does_not_approach() -> None:
    with robot("cancelled-look") as service:
        before = place(service)
        service.put(RobotCommand(name="dock"))
        service.run_cycles(3)
        service.put(RobotCommand(name="cancel"))
        service.until(lambda: said(service, "not docked: cancelled"), max_cycles=5)
        service.run_cycles(30)
        assert service.mode == "idle"
        assert place(service).distance_m(before) < 0.01


def test_nothing_of_a_replaced_motion_goes_on() -> None:
    with robot("replaced-undock", DOCKED @ Pose2(x_m=-0.1)) as service:
        service.put(RobotCommand(name="undock"))
        service.run_cycles(20)
        assert service.bench.truth()[-1, 4] < -0.5  # it reverses
        service.put(RobotCommand(name="dock"))
        service.run_cycles(4)  # it looks for the tag
        assert abs(service.bench.truth()[-1, 4]) < 0.1
        service.put(RobotCommand(name="undock"))
        service.run_cycles(20)
        service.ask("mission/send", {"x_m": START.x_m, "y_m": START.y_m, "tolerance_m": 0.1})
        service.until(lambda: service.mode == "holding", max_cycles=600)
        service.run_cycles(20)
        assert abs(service.bench.truth()[-1, 4]) < 0.1


def test_without_the_camera_the_robot_stops() -> None:
    with robot("blind-dock", retries=0) as service:
        service.put(RobotCommand(name="dock"))
        service.until(lambda: place(service).x_m > -0.5, max_cycles=600)
        service.bench.fault("camera", "unplugged")
        service.until(lambda: said(service, "not docked: lost sight of the dock's tag"), max_cycles=20)
        service.until(lambda: service.mode == "idle", max_cycles=20)
        assert place(service).x_m < -0.3


@pytest.mark.slow
def test_a_robot_that_no_longer_sees_its_dock_gives_up() -> None:
    with robot("vanished-dock", retries=2, staging_m=0.4) as service:
        service.put(RobotCommand(name="dock"))
        service.until(lambda: place(service).x_m > -0.3, max_cycles=600)
        service.bench.fault("camera", "unplugged")
        service.until(lambda: said(service, "not docked: "), max_cycles=1500)
        assert said(service, "not docked: the dock's tag is not in view; tried 3 times"), service.events


@pytest.mark.slow
def test_without_a_charger_at_the_contacts_it_is_not_docked() -> None:
    with robot("dead-charger", retries=0, staging_m=0.4, charger_V=0.3) as service:
        for tries in range(1, 4):  # one approach may end a little beside the dock
            service.put(RobotCommand(name="dock"))
            service.until(lambda n=tries: told(service, "not docked: ") == n, max_cycles=1500)  # type: ignore[misc]
            if said(service, "not docked: no charger at the contacts"):
                return
        raise AssertionError(service.events)


@pytest.mark.slow
def test_a_charger_at_the_contacts_is_found_by_the_voltage() -> None:
    with robot("live-charger", staging_m=0.4, charger_V=0.3) as service:
        service.put(RobotCommand(name="dock"))
        was_there = False
        for _ in range(2500):
            if said(service, "docked: ") or said(service, "not docked: "):
                break
            is_there = place(service).x_m > -0.012
            if is_there != was_there:  # the contacts: half a charge alone has 7.7 V
                service.bench.fault("battery.charge", 1.0 if is_there else 0.5)
            was_there = is_there
            service.run_cycles(1)
        assert said(service, "docked: "), service.events


def test_an_unknown_dock_is_refused() -> None:
    with robot("lost-dock", tag=5) as service:
        service.put(RobotCommand(name="dock"))
        service.until(lambda: said(service, "not docked: the tag is not in view, and the map has no place"))
        service.run_cycles(10)
        assert service.mode == "idle"
