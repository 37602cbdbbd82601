"""Zones that are drawn while the robot runs: it drives round one and slowly through the other."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.e2e.service import FAR, NEAR, Service
from thumper.common.geometry import Pose2
from thumper.maps.annotations import Annotations, load_annotations
from thumper.navigation.footprint import Footprint
from thumper.navigation.speed_limits import SpeedLimits
from thumper.ros.from_ros import path_of
from thumper.runtime.requests import RobotCommand
from thumper.runtime.service.map_saver import MapSaver
from thumper.slam.saved_state import SavedSlamState

KEEPOUT = [[0.7, -0.35], [0.9, -0.35], [0.9, 0.45], [0.7, 0.45]]  # across the straight line to FAR
RUG_MIN_M, RUG_MAX_M = np.array((0.73, -0.32)), np.array((0.87, 0.42))  # less 3 cm of pose error
SLOW = [[0.2, -2.0], [1.0, -2.0], [1.0, 2.0], [0.2, 2.0]]


def zone(kind: str, ring: list[list[float]], **properties: Any) -> dict[str, Any]:
    return {
        "type": "Feature",
        "properties": {"kind": kind, **properties},
        "geometry": {"type": "Polygon", "coordinates": [ring]},
    }


def test_the_robot_drives_round_a_keepout_zone_and_slowly_in_a_slow_zone(service: Service) -> None:
    published: dict[str, Any] = {}
    commands: list[tuple[float, float]] = []  # x and speed

    def listen(topic: str, _stamp_s: float, message: Any) -> None:
        published[topic] = message
        if topic == "cmd_vel":
            commands.append((service.bench.truth()[-1, 1], message.twist.linear.x))

    service.robot.publisher.add_sink(listen)
    send = {"x_m": FAR.x_m, "y_m": FAR.y_m}
    assert service.ask("mission/send", send)["ok"]
    service.run_cycles(8)
    straight_m = path_of(published["plan"])[:, 1]
    assert service.ask("annotation/add", zone("keepout", KEEPOUT, name="rug"))["ok"]
    assert service.ask("annotation/add", zone("slow", SLOW, speed_percent=40))["text"].endswith("'slow 1'")
    service.until(lambda: service.mode == "idle", max_cycles=600)
    assert service.ask("mission/state")["state"] == "reached"
    assert np.abs(straight_m).max() < 0.4  # without the zone it would have crossed it
    track = service.bench.truth()
    outline_m = Footprint().outline_m(0.02)
    for x_m, y_m, theta_rad in track[:, 1:4]:
        outline = Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad).apply(outline_m)
        inside = (outline > RUG_MIN_M) & (outline < RUG_MAX_M)
        assert not inside.all(axis=1).any(), (x_m, y_m)
    in_zone = [v_m_s for x_m, v_m_s in commands if 0.25 < x_m < 0.95]
    assert max(in_zone) <= 0.4 * SpeedLimits().v_max_m_s + 1e-9
    assert max(v_m_s for _, v_m_s in commands) > 0.6 * SpeedLimits().v_max_m_s
    assert len(published["markers"].markers) == 5  # one that deletes, two of each zone


def test_goals_and_zones_that_make_no_sense_are_refused_in_one_line(service: Service) -> None:
    assert service.ask("annotation/add", zone("keepout", KEEPOUT, name="rug"))["ok"]
    goal = {"x_m": 0.8, "y_m": 0.05}
    assert service.ask("mission/send", goal)["error"] == (
        "goal (0.80, 0.05) is in a keep-out zone: choose a goal outside it"
    )
    here = [[1.5, -0.2], [2.0, -0.2], [2.0, 0.3], [1.5, 0.3]]
    assert (
        "the robot is in this keep-out zone" in service.ask("annotation/add", zone("keepout", here))["error"]
    )
    assert "unknown kind" in service.ask("annotation/add", zone("lava", here))["error"]
    assert service.ask("annotation/remove", {"name": "rug"})["text"] == "removed keep-out zone 'rug'"
    assert "there is none" in service.ask("annotation/remove", {"name": "rug"})["error"]
    assert service.ask("mission/send", goal)["ok"]
    service.run_cycles(10)
    assert service.ask("annotation/add", zone("keepout", KEEPOUT, name="rug"))["ok"]
    service.until(lambda: service.mode == "idle")
    assert "keep-out zone" in service.ask("mission/state")["reason"]


def place(name: str, x_m: float, y_m: float) -> dict[str, Any]:
    return {
        "type": "Feature",
        "properties": {"kind": "place", "name": name},
        "geometry": {"type": "Point", "coordinates": [x_m, y_m]},
    }


def test_a_patrol_visits_the_places_in_turn(service: Service) -> None:
    service.ask("annotation/add", place("sofa", 1.5, 0.05))
    service.ask("annotation/add", place("door", 1.2, 0.05))
    assert service.ask("mission/send", {"place": "sofa"})["ok"]
    names = [{"place": "door"}, {"place": "sofa"}]
    assert service.ask("mission/follow", {"goals": names, "rounds": 2})["mission"] == 2
    assert service.ask("mission/state")["legs"] == 4
    service.until(lambda: service.ask("mission/state")["leg"] == 1, max_cycles=600)
    assert abs(service.bench.truth()[-1, 1] - 1.2) < 0.2
    service.put(RobotCommand(name="cancel"))
    assert "choose from: sofa, door" in service.ask("mission/send", {"place": "attic"})["error"]


def test_a_place_where_the_robot_cannot_drive_is_saved_with_a_warning(service: Service) -> None:
    service.ask("annotation/add", zone("keepout", KEEPOUT, name="rug"))
    text = service.ask("annotation/add", place("mat", 0.8, 0.05))["text"]
    assert text.startswith(
        "added place 'mat'; the robot cannot drive there: goal (0.80, 0.05) is in a keep-out"
    )


def test_zones_are_saved_with_the_map(service: Service, tmp_path: Path) -> None:
    assert service.ask("annotation/add", place("sofa", NEAR.x_m, NEAR.y_m))["text"] == "added place 'sofa'"
    assert service.ask("annotation/add", zone("keepout", KEEPOUT, name="rug"))["ok"]
    robot = service.robot
    reports: list[str] = []
    MapSaver(
        robot.mapper.grid,
        lambda: SavedSlamState.from_mapper(robot.mapper, None),
        lambda: robot.annotations,
        tmp_path / "map.yaml",
        lambda text, _ok: reports.append(text),
    )()
    service.until(lambda: bool(reports), max_cycles=600)
    assert "map.geojson" in reports[0]
    loaded = load_annotations(tmp_path / "map.geojson")
    assert loaded == robot.annotations
    assert loaded != Annotations()


def test_a_map_is_saved_under_a_name_and_loaded_again(
    service: Service, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    handler, robot = service.robot.request_handler, service.robot
    assert "saves its map at its end" in service.ask("library/save", {"name": "flat"})["error"]
    reports: list[str] = []
    handler._library._saver = MapSaver(
        robot.mapper.grid,
        lambda: SavedSlamState.from_mapper(robot.mapper, None),
        lambda: robot.annotations,
        tmp_path / "map.yaml",
        lambda text, _ok: reports.append(text),
    )
    service.ask("annotation/add", zone("keepout", KEEPOUT, name="rug"))
    assert service.ask("library/save", {"name": "flat"})["ok"]
    service.until(lambda: bool(reports), max_cycles=600)
    assert "already" in service.ask("library/save", {"name": "flat"})["error"]
    assert "name: use" in service.ask("library/save", {"name": "../flat"})["error"]
    assert [row["name"] for row in service.ask("library/list")["maps"]] == ["flat"]
    service.ask("annotation/remove", {"name": "rug"})
    assert "no map 'attic'" in service.ask("library/load", {"name": "attic"})["error"]
    service.ask("mission/send", {"x_m": FAR.x_m, "y_m": FAR.y_m})
    service.run_cycles(5)
    assert "stationary" in service.ask("library/load", {"name": "flat"})["error"]
    assert "stationary" in service.ask("library/delete", {"name": "flat"})["error"]
    service.put(RobotCommand(name="cancel"))
    service.until(lambda: service.mode == "idle")
    before = robot.map_and_pose()[1]
    assert robot.drive_manager.reason == "cancelled"
    assert "searches" in service.ask("library/load", {"name": "flat"})["text"]
    assert robot.drive_manager.reason == ""  # the drive was in another map
    assert "uses the map" in service.ask("library/delete", {"name": "flat"})["error"]
    assert "uses the map" in service.ask("library/rename", {"name": "flat", "new_name": "attic"})["error"]
    assert robot.annotations.find("rug") is not None
    service.run_cycles(10)
    assert service.ask("mapping/state")["mode"] == "localizing"
    assert robot.map_and_pose()[1].distance_m(before) < 0.3
