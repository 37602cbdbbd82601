"""Tab completes the values of options and arguments."""

import json
from contextlib import closing
from importlib.metadata import EntryPoint

import pytest
import typer.main
from benchmarks.shared.live import free_port
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from thumper.bus.server import BusServer
from thumper.cli.app import build_app
from thumper.cli.bash_completion import whole_words
from thumper.config.bus import BusOptions
from thumper.maps.annotations import Annotations, SavedPlace
from thumper.navigation.registry import PLANNERS
from thumper.ros.to_ros import text
from thumper.runtime.service.request_queue import RequestQueue
from thumper_tuning.design.gains import RULE_NAMES


def offered(command: str, option: str, typed: str = "", *before: str) -> list[str]:
    """Return what Tab offers for an option or argument of a command or subcommand after other words."""
    of = typer.main.get_command(build_app())
    for word in command.split():
        of = of.commands[word]  # type: ignore[attr-defined]
    (parameter,) = [one for one in of.params if option in one.opts]
    context = of.make_context(command, list(before), resilient_parsing=True)
    return [item.value for item in parameter.shell_complete(context, typed)]


@pytest.mark.parametrize("command", ["run", "explore", "doctor"])
def test_ports_are_those_that_are_plugged_in_and_the_simulator(
    command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    port = ListPortInfo("/dev/ttyUSB7")
    port.vid, port.pid = 0x0403, 0x6001
    monkeypatch.setattr(list_ports, "comports", lambda: [port])
    assert offered(command, "--board") == ["/dev/ttyUSB7", "sim://"]
    assert offered(command, "--lidar") == ["/dev/ttyUSB7", "sim://"]


def test_worlds_parameters_and_topics_are_offered() -> None:
    assert {"sim://", "sim://?world=lab", "sim://?world=hall"} <= set(offered("run", "--board", "sim"))
    assert offered("run", "--board", "sim://?world=lab_") == ["sim://?world=lab_box"]
    assert "sim://?world=house-1" in offered("run", "--board", "sim://?world=hou")
    assert {"lab", "hall", "house-1"} <= set(offered("sim", "--world"))
    assert offered("parameters", "words", "k") == ["kp", "ki", "ks", "kv", "ka"]
    assert "scan" in offered("watch", "topic")


def test_planners_and_tuning_rules_are_offered() -> None:
    assert set(offered("plan", "--planner")) == set(PLANNERS)
    for command in ("tune", "tune design"):
        assert set(offered(command, "--rule")) == set(RULE_NAMES)
    assert offered("tune", "--rule", "mi") == ["migo", "migo-1.4"]


def test_places_of_the_running_robot_are_offered() -> None:
    address = f"127.0.0.1:{free_port()}"
    assert offered("goto", "x", "k", "--bus", address) == []  # nothing runs there
    places = (SavedPlace(name="kitchen", x_m=1.0, y_m=2.0), SavedPlace(name="desk", x_m=3.0, y_m=0.5))
    with closing(BusServer("thumper", BusOptions(address=address), RequestQueue(), print)) as server:
        server.publish("annotations", 0.0, text(json.dumps(Annotations(places=places).to_geojson())))
        assert offered("goto", "x", "", "--bus", address) == ["kitchen", "desk"]
        assert offered("goto", "x", "k", "--bus", address) == ["kitchen"]


def test_a_plug_in_without_urls_offers_none(monkeypatch: pytest.MonkeyPatch) -> None:
    other = EntryPoint("other", "json", "thumper.serial_protocols")
    monkeypatch.setattr("thumper.cli.options.common.entry_points", lambda group: [other])
    assert offered("run", "--board", "sim") == ["sim://"]


@pytest.mark.parametrize(
    ("words", "joined", "kept"),
    [
        (["thumper", "watch", "po"], "po", 0),
        (["thumper", "run", "--board", "sim", ":"], "sim:", 4),
        (["thumper", "run", "--board", "sim", ":", "//?world", "=", "la"], "sim://?world=la", 13),
        (["thumper", "run", "--board", "=", "sim", ":", "//?w"], "--board=sim://?w", 4),
        (["thumper", "sim", "--lidar", "="], "--lidar=", 0),
        (["thumper", "sim", ""], "", 0),
        (["thumper", "run", "--board", "'sim://?world=la"], "'sim://?world=la", 0),
    ],
)
def test_words_that_bash_splits_are_joined(words: list[str], joined: str, kept: int) -> None:
    whole, length = whole_words(words, len(words) - 1)
    assert (whole[-1], length) == (joined, kept)
    assert whole[0] == "thumper"
