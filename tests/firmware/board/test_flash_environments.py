"""platformio.ini has one environment per board and boot loader."""

import subprocess
from pathlib import Path

import pytest
from platformio.project.config import ProjectConfig

from thumper.board.flashing import UPLOAD_BAUD
from thumper.board.messages import BoardModel

FIRMWARE = Path(__file__).resolve().parents[3] / "firmware"
INI = FIRMWARE / "platformio.ini"
PLATFORM_BOARD = {"old": "nanoatmega328", "new": "nanoatmega328new"}
"""PlatformIO's board names of the same chip with either boot loader."""


def test_platformio_ini_is_valid() -> None:
    assert ProjectConfig.lint(str(INI)) == {"errors": [], "warnings": []}


def test_each_board_has_exactly_its_two_environments() -> None:
    names = {kind.name.lower() for kind in BoardModel}
    assert set(ProjectConfig(str(INI)).envs()) == names | {f"{name}_new" for name in names}


@pytest.mark.parametrize("bootloader", UPLOAD_BAUD)
@pytest.mark.parametrize("kind", BoardModel, ids=lambda kind: kind.name.lower())
def test_an_environment_uploads_at_its_boot_loaders_speed(kind: BoardModel, bootloader: str) -> None:
    config = ProjectConfig(str(INI))
    section = f"env:{kind.name.lower()}" + ("" if bootloader == "old" else "_new")
    assert config.get(section, "platform") == "atmelavr"
    assert config.get(section, "framework", []) == []
    assert config.get(section, "board") == PLATFORM_BOARD[bootloader]
    assert int(config.get(section, "upload_speed")) == UPLOAD_BAUD[bootloader]
    assert config.get(section, "build_src_filter") == ["+<app/*.cpp> +<board/*.cpp>"]
    assert config.get(section, "build_unflags") == ["-std=gnu++11 -fpermissive"]


def test_make_refuses_an_unknown_board() -> None:
    result = subprocess.run(
        ["make", "-C", str(FIRMWARE), "BOARD=mega"], capture_output=True, text=True, check=False
    )
    assert result.returncode != 0
    assert "unknown board mega" in result.stderr
