"""A running robot switches between mapping and localization."""

import numpy as np

from tests.e2e.service import FAR, NEAR, Service
from thumper.runtime.requests import GoTo, SetPose
from thumper.runtime.service import slam_mode
from thumper.slam.mode_switch import SlamModeSwitch


def command(service: Service, name: str) -> dict[str, object]:
    return service.ask("command", {"command": name})


def test_a_stationary_robot_switches_modes(service: Service) -> None:
    mapper = service.robot.mapper
    assert isinstance(mapper, SlamModeSwitch)
    service.until(lambda: service.robot.inputs.has_map)
    assert command(service, "arm")["ok"]
    service.until(lambda: service.mode == "holding")
    assert command(service, "localize") == {
        "ok": True,
        "text": "the map stays fixed; the robot localizes in it",
    }
    state = {"mode": "localizing", "lost": "", "map_doubt": "", "datum": "", "gps": "off"}
    assert service.ask("mapping/state") == {"ok": True, **state}
    assert service.mode == "idle"  # a large map takes longer than the board waits for a command
    assert str(command(service, "localize")["text"]).endswith("the robot has found its pose in it")
    frozen = mapper.grid()
    service.put(GoTo(goals=(NEAR,)))
    assert "must be stationary" in str(command(service, "map_on")["error"])
    service.until(lambda: service.mode == "idle")
    assert service.ask("mission/state")["state"] == "reached"
    assert mapper.grid() is frozen
    assert service.robot.drive_manager.reason.startswith("at the goal")
    service.put(SetPose(map_from_base=service.robot.map_and_pose()[1]))
    service.until(lambda: service.robot.drive_manager.reason == "")  # a new pose: the drive is over
    service.until(lambda: mapper.quality().lost == "")
    assert command(service, "relocalize")["ok"]
    mapper.relocalize()
    assert slam_mode.change(mapper, "localize").endswith(
        "the robot still searches for its pose: the whole map is searched for the pose"
    )
    service.until(lambda: mapper.quality().lost == "")
    assert command(service, "map_on")["ok"]
    assert service.ask("mapping/state")["mode"] == "mapping"
    service.put(GoTo(goals=(FAR,)))
    service.until(lambda: service.mode == "idle")
    assert service.ask("mission/state")["state"] == "reached"
    assert np.count_nonzero(mapper.grid().cells >= 0) > np.count_nonzero(frozen.cells >= 0)
    assert command(service, "relocalize") == {
        "ok": False,
        "error": "the robot is mapping: localize first, with `thumper mode localize`",
        "option": "",
    }
    service.put(SetPose(map_from_base=service.robot.map_and_pose()[1]))
    refusal = "the pose was not set: the robot is mapping"
    service.until(lambda: any(event.startswith(refusal) for event in service.events))
