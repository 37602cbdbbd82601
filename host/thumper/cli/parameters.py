"""`thumper parameters`: show the parameters of the board, or set them and save them on it."""

from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from thumper.cli.options.common import BoardPort, ConfigFile

if TYPE_CHECKING:
    from thumper.runtime.service.board_jobs import BoardJob

ReplyT = TypeVar("ReplyT")


def _assignments(incomplete: str) -> list[str]:
    """Return what Tab offers: the names of all parameters; a shell adds a space, which would follow `=`."""
    from thumper.board.messages import PARAMETERS

    return [spec.name for spec in PARAMETERS if spec.name.startswith(incomplete)]


def parameters(
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAME=VALUE ...",
            help="What to set, such as kp=6.1; nothing: show all.",
            autocompletion=_assignments,
        ),
    ] = None,
    board: BoardPort = "",
    config: ConfigFile = None,
) -> None:
    """Show the parameters of a board, or set some of them and save them on it.

    It sets all or none. No other program may use the board meanwhile. `thumper tune` finds the gains.
    See `docs/reference/protocol.md` for each parameter.

    Examples:

    - `thumper parameters --board /dev/ttyUSB0`
    - `thumper parameters --board /dev/ttyUSB0 ks=0 kv=0 ka=0`
    """
    from contextlib import closing

    from rich.console import Console
    from rich.table import Table

    from thumper.board.board import Board
    from thumper.board.messages import PARAMETERS
    from thumper.config.robot import load_config, with_ports
    from thumper.runtime.service.board_parameters import change, save, values

    wanted = dict(_parse(word) for word in words or ())
    settings = with_ports(load_config(config), board=board, lidar="")
    with closing(Board.open(settings.board.port, baud=settings.board.baud)) as port:
        if wanted:
            _finished(change(port, wanted))
            _finished(save(port))
        known = _finished(values(port, wanted or [spec.name for spec in PARAMETERS])).values
    table = Table("parameter", "value", "range", "unit")
    for spec in PARAMETERS:
        if spec.name in known:
            limits = f"{spec.minimum:g}...{spec.maximum:g}"
            table.add_row(spec.name, f"{known[spec.name]:.4g}", limits, spec.unit)
    Console().print(table)
    if wanted:
        print(f"saved on the board: {', '.join(wanted)}")


def _finished(job: "BoardJob[ReplyT]") -> "ReplyT":
    """Return the reply of a job that nothing else waits for."""
    while True:
        try:
            next(job)
        except StopIteration as done:
            reply: ReplyT = done.value
            return reply


def _parse(word: str) -> tuple[str, float]:
    from thumper.common.errors import EXIT_USAGE, ThumperError

    name, equals, value = word.partition("=")
    try:
        if not equals:
            raise ValueError
        return name, float(value)
    except ValueError:
        raise ThumperError(
            f"{word!r} sets no parameter; pass NAME=VALUE, such as kp=6.1", exit_code=EXIT_USAGE
        ) from None
