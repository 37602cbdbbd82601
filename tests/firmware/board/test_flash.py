"""`thumper flash` with the real avrdude and the real boot loader on the emulated chip, and every failure."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.firmware.board.boot import BROKEN_OPTIBOOT, HEX, chip_with_bootloader
from thumper.board.firmware_image import firmware_image
from thumper_hil.chip.chip import ChipError
from thumper_hil.chip.hex_file import read_hex
from thumper_hil.chip.instrumented_chip import ATMEGABOOT
from thumper_hil.chip.pty_board import on_pty

THUMPER = Path(sys.executable).with_name("thumper")


def flash(*arguments: str | Path, path: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run the command; `path` replaces the PATH of programs."""
    environment = os.environ | ({"PATH": str(path)} if path else {})
    return subprocess.run(
        [THUMPER, "flash", *map(str, arguments)], capture_output=True, text=True, env=environment, check=False
    )


def tool(folder: Path, name: str, script: str) -> Path:
    """Create a fake tool in `folder`."""
    program = folder / name
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    return folder


def one_line(result: subprocess.CompletedProcess[str]) -> str:
    """Return the error: one line without a traceback."""
    assert result.returncode != 0
    assert result.stderr.count("\n") == 1, result.stderr
    return result.stderr


def test_the_flashed_robot_answers() -> None:
    """The program is written, verified and started by the boot loader, and answers at the firmware's baud
    rate."""
    chip = chip_with_bootloader()
    with on_pty(chip) as port:
        result = flash("--board", port, "--bootloader", "old")
    assert result.returncode == 0, result.stderr
    lines = result.stdout.splitlines()
    progress = [line for line in lines if line.endswith(" %")]
    assert progress == [
        f"{stage}: {n} %" for stage in ("writing", "verifying") for n in (20, 40, 60, 80, 100)
    ]
    assert lines[lines.index("verifying: 100 %") + 1] == "written and verified"
    assert "firmware 0." in result.stdout
    assert "TREX" in result.stdout
    start, image = read_hex(firmware_image("trex", "hex"))
    assert chip.read_flash(start, len(image)) == image
    boot_start, boot_image = read_hex(ATMEGABOOT)
    assert chip.read_flash(boot_start, len(boot_image)) == boot_image
    assert chip.resets >= 3  # one to install, one each time the port was opened


def test_the_other_boot_loader_baud_rate_is_detected() -> None:
    with on_pty(chip_with_bootloader()) as port:
        error = one_line(flash("--board", port, "--bootloader", "new"))
    assert "answers at 57600 baud" in error
    assert "--bootloader old" in error


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        ("avrdude OS error: cannot set attributes for port /dev/x: Inappropriate ioctl", "as a serial port"),
        ("avrdude error: line 1 is no record\navrdude done.  Thank you.", "failed: avrdude error: line 1"),
        ("avrdude: stk500_getsync() attempt 10 of 10: not in sync: resp=0x00", "no boot loader answers"),
        ("avrdude: verification error, first mismatch at byte 0x0000", "verification failed"),
        ("avrdude ser_open() error: cannot open port /dev/x: Permission denied", "permission denied"),
        ("avrdude: something new", "avrdude failed: avrdude: something new"),
    ],
)
def test_avrdude_errors_become_one_line(message: str, expected: str, tmp_path: Path) -> None:
    tools = tool(tmp_path, "avrdude", f"echo '{message}' >&2; exit 1")
    failed = flash("--board", "/dev/null", "--hex", HEX, "--tool", "avrdude", path=tools)
    assert expected in one_line(failed)
    assert failed.stdout == ""  # nothing is flashed before a boot loader answers


def test_a_missing_port_file_or_tool_is_named(tmp_path: Path) -> None:
    avrdude = tool(tmp_path, "avrdude", "exit 0")
    nothing = tmp_path / "nothing"
    assert "no such port" in one_line(flash("--board", nothing, "--hex", HEX, path=avrdude))
    assert "nothing: no such file" in one_line(flash("--board", "/dev/null", "--hex", nothing, path=avrdude))
    no_tool = flash("--board", "/dev/null", "--tool", "avrdude", path=nothing)
    assert "apt install avrdude" in one_line(no_tool)


def test_platformio_uses_the_environment_of_board_and_boot_loader_and_shows_its_lines(tmp_path: Path) -> None:
    arguments = tmp_path / "arguments"
    tools = tool(tmp_path, "pio", f'echo "$@" > {arguments}; echo "Building [new]"; echo Uploading; exit 1')
    failed = flash(
        *("--board", "/dev/null", "--tool", "pio", "--model", "nano", "--bootloader", "new"), path=tools
    )
    one_line(failed)
    assert failed.stdout.splitlines()[1:] == ["Building [new]", "Uploading"]
    assert "-e nano_new -t upload --upload-port /dev/null" in arguments.read_text()


def test_an_overlong_boot_loader_is_refused() -> None:
    chip = chip_with_bootloader()
    with pytest.raises(ChipError, match="past the end of flash"):
        chip.install_bootloader(BROKEN_OPTIBOOT)
