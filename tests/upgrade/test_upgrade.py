"""Files of earlier versions open, or are refused in one line that says what to do.

Each folder holds files that the program of that version wrote: v0_2 from commit 23e965d, with every option of
its configuration at the default. Its firmware saved `eeprom.bin` on the emulated chip: kp 7.5, ki 12, ks 21,
kv 16.5, ka 1.5, acceleration 6, current_limit 7.
"""

import tomllib
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thumper.board.board import Board
from thumper.board.fault_texts import FAULT_HINTS
from thumper.board.messages import Command, Fault, ParameterSource, State
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.common.serial_port import open_port
from thumper.config.robot import load_config
from thumper.maps.map_server_io import load_map
from thumper.recording.reader import Recording
from thumper.recording.replay import replay
from thumper.slam.saved_state import load_session
from thumper_hil.bench import simulation
from thumper_hil.campaign.spec import load_campaign
from thumper_hil.world.world import World
from thumper_tuning.drive.board_gains import armed, next_sample

OLD = Path(__file__).parent / "v0_2"


def options(table: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the dotted keys and values of a TOML file."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from options(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def test_map_and_session_open() -> None:
    grid = load_map(OLD / "map.yaml")
    session = load_session(OLD / "map.session", grid.resolution_m)
    assert session.map_from_base == Pose2(x_m=0.4, theta_rad=0.1)
    assert np.count_nonzero(session.counts.hits) > 100
    assert np.count_nonzero(grid.cells == 100) > 100


def test_recording_opens_and_maps_again() -> None:
    recording = Recording((OLD / "recording.mcap",))
    messages = list(recording.messages())
    decoded = {message.topic: message.decode() for message in messages}
    assert decoded["wheels"].battery_mv == 7600
    assert decoded["wheels"].tx_dropped == 0  # a field that 0.2 did not have
    assert {"wheels", "scan", "odom", "pose", "status", "map", "plan"} <= decoded.keys()
    assert recording.notes == []
    run = recording.run_metadata()
    assert run is not None
    assert run.config.name == "mole"
    result = replay(recording, None)
    assert result.scans > 0
    assert result.unreadable == 0


@pytest.mark.parametrize(
    ("key", "value"), list(options(tomllib.loads((OLD / "robot.toml").read_text(encoding="utf-8"))))
)
def test_every_option_is_known_or_refused_with_the_fix(tmp_path: Path, key: str, value: Any) -> None:
    path = tmp_path / "robot.toml"
    shown = f'"{value}"' if isinstance(value, str) else str(value).lower()
    path.write_text(f"{key} = {shown}\n", encoding="utf-8")
    try:
        load_config(path)
    except ThumperError as error:
        message = str(error)
    else:
        message = "known"
    assert message == "known" or "was removed: it " in message, message


def test_campaign_opens() -> None:
    assert load_campaign(OLD / "campaign.toml").missions


def test_world_opens() -> None:
    assert len(World.load(OLD / "world.toml").segments_m)


def test_board_parameters_are_refused_until_tuning_saves_new_ones() -> None:
    """The old set lacks parameters, so the board starts with the defaults, and says so."""
    with closing(open_port("sim://upgrade/lidar", baud=115_200, name="lidar")):  # keeps the robot
        chip = simulation("upgrade").chip
        chip.write_eeprom((OLD / "eeprom.bin").read_bytes())
        chip.reset()
        with closing(Board.open("sim://upgrade/board", baud=500_000)) as board:
            assert board.identity.parameters is ParameterSource.DEFAULTS
            assert board.poll(1.0)[-1].telemetry.fault is Fault.BAD_PARAMETERS
            assert "`thumper tune`" in FAULT_HINTS[Fault.BAD_PARAMETERS]
            with pytest.raises(ThumperError, match="a fault is latched"):
                board.command(Command.ARM)
            with armed(board):
                next_sample(board, State.CLOSED_LOOP)
            board.command(Command.SAVE)
        chip.reset()
        with closing(Board.open("sim://upgrade/board", baud=500_000)) as board:
            assert board.identity.parameters is ParameterSource.SAVED
            assert board.poll(1.0)[-1].telemetry.fault is Fault.NONE
