"""`thumper flash`: write the firmware through the board's boot loader and check that it answers."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Model(StrEnum):
    """Supported boards."""

    TREX = "trex"
    NANO = "nano"


class Bootloader(StrEnum):
    """Boot loaders that boards come with; they differ in baud rate."""

    OLD = "old"
    NEW = "new"


class Tool(StrEnum):
    """Programs that can write the flash."""

    AUTO = "auto"
    AVRDUDE = "avrdude"
    PIO = "pio"


def flash(
    board: Annotated[str, typer.Option(help="Serial port of the board, such as /dev/ttyUSB0.")],
    model: Annotated[Model, typer.Option(help="The board's model: its firmware.")] = Model.TREX,
    bootloader: Annotated[
        Bootloader,
        typer.Option(help="old: 57600 baud (T'REX, most Nanos); new: 115200 baud (Uno, Nanos since 2018)."),
    ] = Bootloader.OLD,
    hex_file: Annotated[
        Path | None,
        typer.Option("--hex", help="Firmware file; without it, the one that `make firmware` built."),
    ] = None,
    tool: Annotated[
        Tool, typer.Option(help="avrdude or PlatformIO; auto uses the installed one.")
    ] = Tool.AUTO,
    baud: Annotated[int, typer.Option(help="Baud rate of the running firmware.", min=1)] = 500_000,
) -> None:
    """Flash a board, verify the flash, and check that the firmware answers.

    Example: `thumper flash --board /dev/ttyUSB0`
    """
    from rich.console import Console

    from thumper.board.board import Board
    from thumper.board.firmware_image import firmware_image
    from thumper.board.flashing import FlashJob, flash_board
    from thumper.common.errors import EXIT_USAGE, ThumperError

    if hex_file is not None and not hex_file.is_file():
        raise ThumperError(
            f"{hex_file}: no such file; leave out --hex to flash what `make firmware` built",
            exit_code=EXIT_USAGE,
        )
    job = FlashJob(
        port=board,
        hex_file=hex_file or firmware_image(model.value, "hex"),
        board=model.value,
        bootloader=bootloader.value,
    )
    console = Console(highlight=False, markup=False, soft_wrap=True)
    flash_board(job, tool=tool.value, report=console.print)
    console.print("written and verified")
    robot = Board.open(board, baud=baud)
    try:
        i = robot.identity
    finally:
        robot.close()
    console.print(
        f"firmware {i.version_major}.{i.version_minor}.{i.version_patch} for the {i.board.name} runs at "
        f"{i.control_rate_Hz} Hz"
    )
