"""Clients choose another simulated world: the robot starts again there, with a new map."""

import signal
import subprocess
from pathlib import Path
from typing import Any

from benchmarks.shared.live import END_WITH_PARENT, free_port, until

from tests.e2e.conftest import THUMPER
from tests.e2e.service import FAR, Service
from thumper.bus.client import BusClient
from thumper.common.errors import ThumperError
from thumper.ros import services


def test_a_robot_in_motion_stays_in_its_world(service: Service) -> None:
    simulation = service.robot.request_handler.simulation
    assert service.ask("simulator/world")["worlds"] == []
    assert "thumper run" in service.ask("simulator/command", {"world": "hall"})["error"]
    simulation.can_restart = True
    assert {"lab", "hall", "house-1"} <= set(service.ask("simulator/world")["worlds"])
    assert "choose from" in service.ask("simulator/command", {"world": "moon"})["error"]
    service.ask("mission/send", {"x_m": FAR.x_m, "y_m": FAR.y_m})
    service.run_cycles(5)
    assert "motors off" in service.ask("simulator/command", {"world": "hall"})["error"]
    service.ask("command", {"command": "cancel"})
    service.ask("command", {"command": "disarm"})
    service.until(lambda: service.mode == "idle")
    assert simulation.next_world == ""
    assert service.ask("simulator/command", {"world": "hall"})["ok"]
    assert service.robot.serve(speed=20.0)
    assert simulation.next_world == "hall"


SCANS = 20  # more than a map needs


def until_it_maps(address: str, world: str) -> None:
    """Wait until the robot runs in a world and has a map."""

    def maps() -> bool:
        found: list[Any] = []
        try:
            with BusClient("thumper", address) as client:
                client.subscribe("scan", found.append)
                if services.SIMULATOR_WORLD.call(client).world == world:
                    until(lambda: len(found) >= SCANS)
        except ThumperError:  # it starts
            return False
        return len(found) >= SCANS

    until(maps)


def test_a_run_starts_again_in_the_chosen_world_and_keeps_both_maps(tmp_path: Path) -> None:
    address = f"127.0.0.1:{free_port()}"
    board = "sim://?world=lab&x_m=0.5&seed=3"
    command = [str(THUMPER), "run", "--board", board, "--bus", address, "--out", str(tmp_path)]
    process = subprocess.Popen([*END_WITH_PARENT, *command], stdout=subprocess.PIPE, text=True)
    until_it_maps(address, "lab")
    with BusClient("thumper", address) as client:
        services.SIMULATOR_COMMAND.call(client, {"world": "hall"})
    until_it_maps(address, "hall")
    process.send_signal(signal.SIGINT)
    printed, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert "the robot starts again in the world hall" in printed
    assert (tmp_path / "map.yaml").exists()
    assert (tmp_path / "hall/map.yaml").exists()
