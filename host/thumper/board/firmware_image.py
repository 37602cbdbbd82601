"""Where a board's built firmware lies: as `make firmware` leaves it in a source tree, or within a wheel."""

from pathlib import Path

IN_WHEEL = Path(__file__).parents[1] / "images"
IN_SOURCES = Path(__file__).resolve().parents[3] / "firmware" / "build"


def firmware_image(board: str, suffix: str) -> Path:
    """The image of `trex` or `nano`, `suffix` elf or hex; it need not be there."""
    if IN_WHEEL.is_dir():
        return IN_WHEEL / board / f"thumper.{suffix}"
    return IN_SOURCES / ("" if board == "trex" else board) / f"thumper.{suffix}"
