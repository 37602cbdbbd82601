"""A mistyped command line gives one line in the style of all errors, and exit status 2."""

import sys
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import pytest
import typer

from tests.host.cli.conftest import Ended
from thumper.cli import app
from thumper.common.errors import EXIT_INTERRUPTED, EXIT_USAGE

Refusal = Callable[..., str]


def commands(group: object, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Yield the words of each command and subcommand."""
    for name, command in getattr(group, "commands", {}).items():
        yield (*path, name)
        yield from commands(command, (*path, name))


@pytest.fixture
def refusal(thumper: Callable[..., Ended]) -> Refusal:
    """Return a function that runs `thumper` with wrong arguments and returns its one line."""

    def run(*arguments: str) -> str:
        ended = thumper(*arguments)
        assert (ended.status, ended.out) == (EXIT_USAGE, "")
        (line,) = ended.err.splitlines()
        return line

    return run


@pytest.mark.parametrize("words", [*commands(typer.main.get_command(app.build_app()))], ids=" ".join)
def test_unknown_option_of_each_command(refusal: Refusal, words: tuple[str, ...]) -> None:
    name = " ".join(words)
    assert refusal(*words, "--xyzzy") == (
        f"thumper: {name}: no such option --xyzzy; see `thumper {name} --help`"
    )


@pytest.mark.parametrize(
    ("typed", "line"),
    [
        ("got 1 2", "thumper: no such command 'got'; did you mean 'goto'? See `thumper --help`"),
        ("goal 1 2", "thumper: no such command 'goal'; did you mean 'goto'? See `thumper --help`"),
        ("tune recrod", "tune: no such command 'recrod'; did you mean 'record'? See `thumper tune --help`"),
        ("run --gaol 1 2", "run: no such option --gaol; did you mean --goal? See `thumper run"),
        ("run --bogus", "run: no such option --bogus; see `thumper run"),
        ("goto 1 -0.5 --tolerence=1", "goto: no such option --tolerence; did you mean --tolerance? See"),
        ("goto -1 north", "goto: invalid value for 'Y': 'north' is not a number; see `thumper goto --help`"),
        ("goto north 1", "'north' is not a number; a goal is X Y or the name of a place"),
        ("run --goal 1 0 --goal=2 0", "run: --goal is given twice, but takes one value; see `thumper run"),
        ("run --ui-port 8081", "--ui-port belongs to --ui"),
        ("run --goal 1", "run: --goal is X Y: the Y is missing; see `thumper run --help`"),
        ("run --goal --board sim://", "run: --goal is X Y: the X is missing; see"),
        ("run --goal=1 --board sim://", "run: --goal is X Y: the Y is missing; see"),
        ("run --waypoint 1 --goal 2 3", "run: --waypoint is X Y: the Y is missing; see"),
        ("run --start 0 0 --board sim://", "run: --start is X Y DEGREES: the DEGREES is missing; see"),
        ("plan MAP --goal -1 --start 0 0", "plan: --goal is X Y: the Y is missing; see"),
        ("goto --gps 48 --no-wait", "goto: --gps is LAT LON: the LON is missing; see"),
        ("goto 1,-2", "'1,-2' is no place; write X Y with a space: thumper goto 1 -2"),
        ("mode localization", "'search'; did you mean 'localize'? See `thumper mode --help`"),
        ("tune --lane", "tune: option '--lane' requires an argument; see `thumper tune --help`"),
        ("run --tolerance 7", "run: invalid value for '--tolerance': "),
        ("run --goal a b", "run: invalid value for '--goal': 'a' "),
        ("plan", "plan: missing argument 'MAP.yaml'; see `thumper plan --help`"),
        ("watch stauts", "unknown topic 'stauts'; did you mean 'status'?"),
        ("watch cmd_vl", "unknown topic 'cmd_vl'; did you mean 'cmd_vel'"),
        ("watch xyzzy", "unknown topic 'xyzzy'; choose from: scan, imu,"),
    ],
)
def test_mistyped_words(refusal: Refusal, typed: str, line: str) -> None:
    assert line in refusal(*typed.split())


@pytest.mark.parametrize(
    ("answer", "status", "line"),
    [
        (KeyboardInterrupt, EXIT_INTERRUPTED, "thumper: interrupted"),
        (EOFError, EXIT_USAGE, "thumper: nobody answers the question; pass --yes to skip it"),
    ],
)
def test_question_without_an_answer(
    monkeypatch: pytest.MonkeyPatch,
    thumper: Callable[..., Ended],
    answer: type[BaseException],
    status: int,
    line: str,
) -> None:
    def ask() -> None:
        typer.confirm("Is it free?")

    def readline(*_: object) -> str:
        raise answer

    monkeypatch.setattr(app, "COMMANDS", {"ask": ask})
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(readline=readline))
    ended = thumper("ask")
    assert (ended.status, ended.err.strip()) == (status, line)
