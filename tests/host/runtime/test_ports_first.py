"""A wrong port or world is refused before the kernels are compiled, which may take minutes."""

from pathlib import Path

import pytest

from thumper.common.errors import EXIT_NOT_THERE, EXIT_USAGE, ThumperError
from thumper.common.serial_port import check_port
from thumper.config.robot import RobotConfig, with_ports
from thumper.runtime import assembly


def test_a_device_whose_name_begins_with_sim_is_no_wrong_url(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sim_board").symlink_to("/dev/null")
    check_port("sim_board", "board")


@pytest.mark.parametrize(
    ("board", "lidar", "status", "words"),
    [
        ("/dev/ttyNONE9", "", EXIT_NOT_THERE, "there is no such port; is it plugged in?"),
        ("sim://ports/board", "/dev/ttyNONE8", EXIT_NOT_THERE, "the lidar port /dev/ttyNONE8: there is no"),
        ("sim://?world=hal", "", EXIT_USAGE, "hal: unknown world; did you mean 'hall'?"),
        (
            "sim://?world=xyzzy",
            "",
            EXIT_USAGE,
            "cannot simulate the board: xyzzy: unknown world; choose from: ",
        ),
        ("README.md", "/dev/null", EXIT_USAGE, "README.md: a file or folder, not the board port"),
        ("sim:/", "", EXIT_USAGE, "sim:/: no such port; did you mean 'sim://'?"),
        ("sim://?wrld=hall", "", EXIT_USAGE, "unknown simulator option 'wrld'; did you mean 'world'?"),
        ("sim://?x_m=90", "", EXIT_USAGE, "choose a free start"),
        ("sim://ports/bord", "sim://ports/lidar", EXIT_USAGE, "sim://ports/bord: not a simulated device"),
        ("telepathy://board", "/dev/null", EXIT_USAGE, "no such kind of port"),
    ],
)
def test_wrong_port(monkeypatch: pytest.MonkeyPatch, board: str, lidar: str, status: int, words: str) -> None:
    monkeypatch.setattr(assembly, "warm_up", lambda _: pytest.fail("compiles before it looks at the ports"))
    config = with_ports(RobotConfig(), board=board, lidar=lidar)
    with pytest.raises(ThumperError) as refusal, assembly.open_robot(config, None):
        pass
    assert words in str(refusal.value)
    assert refusal.value.exit_code == status
