"""`thumper goto`, `stop`, `save`, `status`, `watch` against a running robot in another process."""

import json
import math
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from benchmarks.shared.live import END_WITH_PARENT, free_port, until

from tests.e2e.conftest import THUMPER
from thumper.bus.client import BusClient
from thumper.ros.codec import Message

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def thumper(in_process: Run) -> Run:
    """Run each command in this process: its files, messages and exit status are the same."""
    return in_process


@pytest.fixture(scope="module")
def bus(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Start a simulated robot in the lab; return its bus address."""
    address, out = f"127.0.0.1:{free_port()}", tmp_path_factory.mktemp("service")
    world = "sim://commands/board?world=lab&x_m=1.73&y_m=0.08&yaw_deg=180"
    command = [str(THUMPER), "run", "--board", world, "--lidar", "sim://commands/lidar", "--bus", address]
    command += ["--start", "1.73", "0.08", "180", "--speed", "1", "--out", str(out)]
    process = subprocess.Popen(
        [*END_WITH_PARENT, *command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert "is running on" in process.stdout.readline()
    with BusClient("thumper", address) as client:
        maps: list[Message] = []
        client.subscribe("map", maps.append)
        until(lambda: len(maps) > 1)  # a second apart: the first may hold too few scans to accept a goal
    yield address
    process.send_signal(signal.SIGINT)
    rest, errors = process.communicate(timeout=20)
    assert process.returncode == 0, errors
    assert "stopped" in rest


def test_goto_waits_for_arrival(thumper: Run, bus: str) -> None:
    done = thumper("goto", "1.2", "0.05", "--bus", bus)
    assert done.returncode == 0, done.stderr
    assert "m to go" in done.stdout
    assert re.search(r"^thumper is at the goal \(1\.20, 0\.05\) after \d+\.\d s$", done.stdout, re.MULTILINE)
    status = json.loads(thumper("status", "--json", "--bus", bus).stdout)
    assert (status["robot"], status["simulated"], status["has_goal"]) == ("thumper", True, False)
    assert math.dist((status["pose"]["x_m"], status["pose"]["y_m"]), (1.2, 0.05)) < 0.1
    assert status["battery_V"] > 6.0
    assert "\nmode     mapping\n" in (text := thumper("status", "--bus", bus).stdout)
    assert "earth" not in text


def test_without_a_datum_a_goal_on_earth_is_refused_in_one_line(thumper: Run, bus: str) -> None:
    done = thumper("goto", "--gps", "-33.8568", "151.2153", "--bus", bus)
    assert done.returncode == 1
    (line,) = done.stderr.strip().splitlines()
    assert line.endswith(
        "the map has no place on Earth: it needs a datum in its YAML, "
        "or [gps] and a drive with a fix, of 1 to 2 m with RTK, else of 30 m and more"
    )
    assert thumper("goto", "1.2", "--gps", "48.0", "11.0", "--bus", bus).returncode == 2
    assert thumper("goto", "--bus", bus).returncode == 2


def test_gains_for_a_running_robot_need_a_drive_that_shows_its_wheels(
    thumper: Run, bus: str, tmp_path: Path
) -> None:
    refused = thumper("tune", "design", "--bus", bus, "--out", str(tmp_path / "out"))
    assert refused.returncode == 4
    assert "has not determined the gain" in refused.stderr
    assert "wheels   " in thumper("status", "--bus", bus).stdout


def interrupted(*arguments: str, first: str) -> tuple[int, str]:
    """Send Ctrl-C to a command once its `first` line is there; return its exit code and its errors."""
    process = subprocess.Popen(
        [*END_WITH_PARENT, str(THUMPER), *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert first in process.stdout.readline()
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=20)
    return process.returncode, errors


def test_ctrl_c_cancels_the_goal(thumper: Run, bus: str) -> None:
    code, errors = interrupted("goto", "--bus", bus, "--", "0.2", "0.05", "180", first="m to go")
    assert code == 130
    assert "goal cancelled" in errors
    until(lambda: '"idle"' in thumper("status", "--json", "--bus", bus).stdout)


def test_explore_lets_the_running_robot_explore_and_waits(thumper: Run, bus: str) -> None:
    done = thumper("explore", "--bus", bus)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[0].startswith("exploring, for 15 minutes at most")
    assert "back at the start\n" in done.stdout
    refused = thumper("explore", "--bus", bus, "--minutes", "3")
    assert (refused.returncode, refused.stderr.count("\n")) == (2, 1)
    assert "a robot is running: leave out --minutes" in refused.stderr


def test_ctrl_c_cancels_the_exploration(bus: str) -> None:
    ended = interrupted("explore", "--bus", bus, first="exploring")
    assert ended == (130, "thumper: interrupted; the robot stops\n")


def test_save_waits_for_the_files(thumper: Run, bus: str) -> None:
    done = thumper("save", "--bus", bus)
    assert done.returncode == 0, done.stderr
    image, *beside = done.stdout.strip().removeprefix("map saved: ").split(", ")
    assert all((Path(image).parent / name).stat().st_size for name in (Path(image).name, *beside))
    assert beside == ["map.yaml", "map.session"]


def test_stop(thumper: Run, bus: str) -> None:
    assert thumper("goto", "--no-wait", "--bus", bus, "--", "-0.4", "0.05").returncode == 0
    assert "cancelled; the robot stops" in thumper("stop", "--bus", bus).stdout
    assert "latched" not in thumper("status", "--bus", bus).stdout
    assert "emergency stop" in thumper("stop", "--emergency", "--bus", bus).stdout
    time.sleep(0.5)
    assert "emergency stop was pressed" in thumper("status", "--bus", bus).stdout
    nowhere = thumper("goto", "kitchen", "--bus", bus)
    assert (nowhere.returncode, nowhere.stderr.count("\n")) == (1, 1)
    assert "no place 'kitchen' on this map" in nowhere.stderr
    refused = thumper("goto", "1.5", "0.05", "--bus", bus)
    assert refused.returncode == 1
    assert "--clear-fault" in refused.stderr
    assert thumper("goto", "--clear-fault", "1.5", "0.05", "--bus", bus).returncode == 0


def test_watch(thumper: Run, bus: str) -> None:
    lines = thumper("watch", "wheels", "--json", "--count", "3", "--bus", bus).stdout.splitlines()
    times = [json.loads(line)["time_us"] for line in lines]
    assert [after - before for before, after in pairwise(times)] == [100_000] * 2
    assert " V, 0.00 A drawn" in thumper("watch", "battery", "--count", "1", "--bus", bus).stdout


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["status", "--bus", "127.0.0.1:1"], 3, "`thumper run --board sim://` simulates one"),
        (["stop", "--bus", "nonsense"], 2, "use HOST:PORT"),
        (["dashboard", "--bus", "nonsense"], 2, "use HOST:PORT"),
        (["flash", "--board", "/dev/null", "--hex", "none.hex"], 2, "none.hex: no such file"),
        (["watch", "nonsense"], 2, "unknown topic 'nonsense'"),
        (["goto", "nan", "0"], 2, "finite"),
        (["goto", "1.5"], 2, "the Y is missing"),
        (["goto", "1", "0", "720"], 2, "-360 to 360 degrees"),
        (["run", "--patrol", "2"], 2, "--patrol belongs to --waypoint"),
        (["run", "--bus", "0.0.0.0:7448"], 2, "set a token"),
        (["explore", "--bus", "0.0.0.0:7448"], 2, "set a token"),
    ],
)
def test_errors_take_one_line(thumper: Run, arguments: list[str], code: int, words: str) -> None:
    done = thumper(*arguments)
    assert done.returncode == code
    assert words in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_robot_of_another_name_does_not_answer(thumper: Run, bus: str, tmp_path: Path) -> None:
    config = tmp_path / "other.toml"
    config.write_text(f'name = "other"\n[bus]\naddress = "{bus}"\n', encoding="utf-8")
    done = thumper("stop", "--config", config)
    assert done.returncode == 3
    assert "no robot 'other' answers" in done.stderr


@pytest.mark.parametrize(
    ("command", "problem"),
    [
        (["foxglove", "--port", str(free_port()), "--robot", "nobody"], "publishes nothing on this bus"),
        (["ros", "--robot", "nobody", "--router"], "is the robot's own bus"),
    ],
)
def test_bridges_refuse_what_would_stay_silent(
    thumper: Run, bus: str, command: list[str], problem: str
) -> None:
    refused = thumper(*command, *([bus] if command[-1] == "--router" else []), "--bus", bus)
    assert refused.returncode in {2, 3}
    assert problem in refused.stderr
