"""Terminal helpers for commands that drive: open the board, confirm free floor, show progress."""

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import Progress

from thumper.board.board import Board
from thumper.common.errors import EXIT_INTERRUPTED, ThumperError
from thumper.config.own_simulation import own_simulation
from thumper.lidar.options import LidarOptions
from thumper_tuning.drive.record import ReportProgress

LANE_WIDTH_M = 0.8


@contextmanager
def open_board(url: str, baud: int) -> Iterator[Board]:
    """Open a board; at the end stop and close it. Ctrl-C becomes a one-line error.

    `sim://` is a new simulated robot, as in the other commands.
    """
    port, _ = own_simulation(url, "", LidarOptions().model)
    board = Board.open(port, baud=baud)
    try:
        yield board
    except KeyboardInterrupt:
        raise ThumperError("interrupted; the motors are stopped", exit_code=EXIT_INTERRUPTED) from None
    finally:
        board.close()


def confirm_room(room: str, console: Console, *, yes: bool) -> None:
    """Print how much room the drive needs, and ask whether it is free; `yes` skips the question.

    Raises
    ------
    ThumperError
        The answer is no.
    """
    import typer

    console.print(f"The robot will drive by itself: it needs {room}. Ctrl-C stops it.")
    if not yes and not typer.confirm("Is it free?"):
        raise ThumperError("not confirmed; nothing was driven")


@contextmanager
def progress_bar(console: Console, title: str = "") -> Iterator[ReportProgress]:
    """Show a progress bar; yield the function to report to. A total of 0 means unknown."""
    prefix = f"{title}: " if title else ""
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task(title, total=None)
        yield lambda done, total, activity: progress.update(
            task, completed=done, total=total or None, description=prefix + activity
        )
