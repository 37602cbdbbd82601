"""Path of a board's built firmware: in the output of `make firmware`, or inside an installed wheel."""

from pathlib import Path

IN_WHEEL = Path(__file__).parents[1] / "images"
IN_SOURCES = Path(__file__).resolve().parents[3] / "firmware" / "build"


def firmware_image(board: str, suffix: str) -> Path:
    """Return the path of the image of `trex` or `nano`, `suffix` elf or hex. The file may not exist."""
    if IN_WHEEL.is_dir():
        return IN_WHEEL / board / f"thumper.{suffix}"
    return IN_SOURCES / ("" if board == "trex" else board) / f"thumper.{suffix}"
