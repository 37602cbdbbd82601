"""`thumper flash`: put the firmware on a board through its own boot loader, and see that it answers."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Target(StrEnum):
    """Boards that there is a firmware for."""

    TREX = "trex"
    NANO = "nano"


class Bootloader(StrEnum):
    """The boot loader that came with the board: they differ in speed."""

    OLD = "old"
    NEW = "new"


class Tool(StrEnum):
    """What does the flashing."""

    AUTO = "auto"
    AVRDUDE = "avrdude"
    PIO = "pio"


def flash(
    port: Annotated[str, typer.Option(help="The board's serial port, such as /dev/ttyUSB0.")],
    board: Annotated[Target, typer.Option(help="Which board it is.")] = Target.TREX,
    bootloader: Annotated[
        Bootloader,
        typer.Option(help="old: 57600 baud (T'REX, most Nanos); new: 115200 baud (Uno, Nanos since 2018)."),
    ] = Bootloader.OLD,
    hex_file: Annotated[
        Path | None,
        typer.Option("--hex", help="The firmware; without it, the one that `make firmware` built."),
    ] = None,
    tool: Annotated[Tool, typer.Option(help="avrdude or PlatformIO; auto takes what is there.")] = Tool.AUTO,
    baud: Annotated[int, typer.Option(help="Rate of the firmware once it runs.", min=1)] = 500_000,
) -> None:
    """Flash a board, read the flash back and compare, then shake hands with what runs on it."""
    from rich.console import Console

    from thumper.board.board import Board
    from thumper.board.firmware_image import firmware_image
    from thumper.board.flashing import FlashJob, flash_board
    from thumper.common.errors import EXIT_USAGE, ThumperError

    if hex_file is not None and not hex_file.is_file():
        raise ThumperError(
            f"{hex_file}: no such file; without --hex it is what `make firmware` built", exit_code=EXIT_USAGE
        )
    job = FlashJob(
        port=port,
        hex_file=hex_file or firmware_image(board.value, "hex"),
        board=board.value,
        bootloader=bootloader.value,
    )
    console = Console(highlight=False)
    console.print(f"flashing {job.hex_file} to {port} at {job.upload_baud} baud")
    flash_board(job, tool=tool.value)
    console.print("written and verified")
    robot = Board.open(port, baud=baud)
    try:
        i = robot.identity
    finally:
        robot.close()
    console.print(
        f"firmware {i.version_major}.{i.version_minor}.{i.version_patch} for the {i.board.name} runs at "
        f"{i.control_rate_Hz} Hz"
    )
