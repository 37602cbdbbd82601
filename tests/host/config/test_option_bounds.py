"""Numbers out of range and mismatched ports are refused before any port is opened."""

import pytest
from typer.testing import CliRunner

from thumper.cli.app import build_app
from thumper.common.errors import ThumperError

HUGE = "9" * 23


@pytest.mark.parametrize(
    ("command", "option", "value"),
    [
        ("run --goal 1 0", "--patrol", "100000000000"),
        ("demo", "--seeds", HUGE),
        ("demo", "--seed", HUGE),
        ("sim", "--seed", HUGE),
        ("map-log none.log", "--seed", HUGE),
        ("edit none.yaml --out new.yaml", "--rotate", "1e300"),
        ("run --goal 1 0", "--tolerance", "1e9"),
        ("plan none.yaml --start 0 0 --goal 1 0", "--tolerance", "1e9"),
    ],
)
def test_number_out_of_bounds_names_its_option(command: str, option: str, value: str) -> None:
    result = CliRunner().invoke(build_app(), [*command.split(), option, value])
    assert result.exit_code == 2
    assert option in result.output
    assert "less than or equal" in result.output


@pytest.mark.parametrize(
    "command",
    [
        "run --board none --goal 1e300 0",
        "run --board none --waypoint 0 1e300",
        "run --board none --start 1e300 0 0",
        f"explore --board none --session {__file__} --start 1e300 0 0",
        "map-log none --session none --start 1e300 0 0",
        "goto 1e300 0 --bus 127.0.0.1:1",
    ],
)
def test_position_beyond_any_map_is_refused(command: str) -> None:
    error = CliRunner().invoke(build_app(), command.split()).exception
    assert isinstance(error, ThumperError)
    assert "1e+300" in str(error)
    assert "is farther than 1000 m from the map's origin" in str(error)
    assert error.exit_code == 2


@pytest.mark.parametrize("command", ["run --goal 1 0", "explore", "doctor", "experiment odometry"])
def test_ports_of_two_simulated_robots_are_refused(command: str) -> None:
    ports = ["--board", "sim://x/board?world=lab", "--lidar", "sim://q/lidar"]
    error = CliRunner().invoke(build_app(), [*command.split(), *ports]).exception
    assert isinstance(error, ThumperError)
    assert "sim://x and sim://q are two simulated robots" in str(error)
    assert error.exit_code == 2
