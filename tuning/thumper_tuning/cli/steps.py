"""What the commands of `thumper tune` do."""

import dataclasses
import json
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from thumper.board.board import Board
from thumper.board.messages import Command
from thumper.common.errors import EXIT_INTERRUPTED, EXIT_USAGE, ThumperError
from thumper_tuning.cli.fit import runs_of, show
from thumper_tuning.design.fixed_point import BoardGains, on_the_wire
from thumper_tuning.design.gains import Design, DesignOptions, design, nominal
from thumper_tuning.drive.board_gains import read_gains, write_gains
from thumper_tuning.drive.excitation import ExcitationOptions
from thumper_tuning.drive.record import Show, record
from thumper_tuning.drive.verify import Verification, VerifyOptions, verify
from thumper_tuning.identify.motor import Identified, identify

LANE_WIDTH_M = 0.8
LARGEST_WORST = 2.0  # Ms over the family that is passed over in silence


@contextmanager
def opened(url: str) -> Iterator[Board]:
    """A board that is stopped and closed whatever happens; Ctrl-C is one line."""
    board = Board.open(url, baud=500_000)
    try:
        yield board
    except KeyboardInterrupt:
        raise ThumperError("interrupted; the motors are stopped", exit_code=EXIT_INTERRUPTED) from None
    finally:
        board.close()


def confirm_room(room: str, console: Console, *, yes: bool) -> None:
    """Say what room a drive by itself takes, and ask whether it is free, unless told so (`yes`).

    Raises
    ------
    ThumperError
        It is not.
    """
    import typer

    console.print(f"The robot will drive by itself: it needs {room}. Ctrl-C stops it.")
    if not yes and not typer.confirm("Is it free?"):
        raise ThumperError("not confirmed; nothing was driven")


@contextmanager
def bar(console: Console, title: str) -> Iterator[Show]:
    """A progress bar to report to."""
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task(title, total=None)
        yield lambda done, total, what: progress.update(
            task, completed=done, total=total, description=f"{title}: {what}"
        )


def record_to(board: Board, path: Path, options: ExcitationOptions, console: Console) -> Path:
    """Drive the identification experiment."""
    with bar(console, "recording") as progress:
        return record(board, options, path, progress)


def identify_files(files: list[Path], counts_per_rev: float, one_direction: bool = False) -> list[Identified]:
    """Identify every motor of the logs and print what is known."""
    motors = [identify(logs, one_direction=one_direction) for logs in runs_of(files, counts_per_rev)]
    for motor in motors:
        show(motor)
    return motors


def design_for(
    motors: list[Identified], options: DesignOptions, battery_V: float | None, console: Console
) -> Design:
    """Design and print."""
    model, std = nominal(motors, battery_V)
    result = design(model, std, options)
    for name, value in result.gains.items():
        console.print(f"  {name:13} {value:9.4f}   ({result.gains.integers()[name]} on the wire)")
    loop, step = result.loop, result.step
    console.print(
        f"  Ms {loop.sensitivity:.2f} (worst of the family {result.worst.sensitivity:.2f}), gain margin "
        f"{loop.gain_margin:.2f}, phase margin {loop.phase_margin_deg:.0f} deg, delay margin "
        f"{loop.delay_margin_s:.3f} s; PI alone: settles in {step.settle_s:.2g} s, overshoot "
        f"{step.overshoot_percent:.0f} %"
    )
    if not result.worst.stable:
        console.print("  note: not every plant of the family is stable with these gains; choose a smaller Ms")
    elif result.worst.sensitivity > LARGEST_WORST:
        console.print(
            "  note: with another load or battery the loop comes near to ringing (worst Ms); "
            "`--ms 1.4` or a lower control rate leaves more margin"
        )
    return result


def verify_on(
    board: Board, gains: BoardGains, options: VerifyOptions, path: Path, console: Console
) -> Verification:
    """Drive the trapezoids with these gains and print how well they were followed."""
    with bar(console, "verifying") as progress:
        result = verify(board, gains, options, path, progress)
    for t in result.tracking:
        console.print(
            f"  ramp {t.acceleration_rad_s2:g} rad/s^2: error mean {t.mean_rad_s:+.3f}, std "
            f"{t.std_rad_s:.3f} rad/s (a loop without preview: {t.floor_rad_s:.2f} at best)"
        )
    return result


def write_gains_file(path: Path, result: Design) -> Path:
    """The gains and the integers to flash, for machines."""
    content = {
        "gains": dict(result.gains.items()),
        "wire": result.gains.integers(),
        "period_s": result.period_s,
        "model": dataclasses.asdict(result.model),
        "Ms": result.loop.sensitivity,
    }
    path.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    return path


def read_gains_file(path: Path) -> BoardGains:
    """Read what `tune design` has written."""
    names = [entry.name for entry in dataclasses.fields(BoardGains)]
    try:
        gains = json.loads(path.read_text(encoding="utf-8"))["gains"]
        return on_the_wire(**{name: float(gains[name]) for name in names})
    except OSError as error:
        raise ThumperError(
            f"{path}: cannot read the gains: {error.strerror}", exit_code=EXIT_USAGE
        ) from error
    except (ValueError, KeyError, TypeError) as error:
        raise ThumperError(
            f"{path}: there is not each of {', '.join(names)} in it; `thumper tune design` writes them",
            exit_code=EXIT_USAGE,
        ) from error


def tune_all(
    board_url: str,
    out: Path,
    excitation: ExcitationOptions,
    verification: VerifyOptions,
    options: DesignOptions,
    *,
    yes: bool,
    console: Console,
) -> None:
    """Record, fit, design, verify before and after, report; the board keeps the new gains only if
    confirmed, and then over resets. Cut short, it has its old ones again."""
    import typer

    from thumper_tuning.report.page import write_report

    with opened(board_url) as board:
        lane_m = verification.lane_m(board.identity.wheel_radius_mm / 1000.0)
        confirm_room(
            f"a lane {LANE_WIDTH_M:g} m wide, {max(excitation.lane_m, lane_m):.1f} m ahead and "
            f"{excitation.lane_m:.1f} m behind",
            console,
            yes=yes,
        )
        old = read_gains(board)
        try:
            log = record_to(board, out / "identification.csv", excitation, console)
            motors = identify_files([log], board.identity.counts_per_rev)
            period_s = 1.0 / board.identity.control_rate_Hz
            result = design_for(motors, dataclasses.replace(options, period_s=period_s), None, console)
            write_gains_file(out / "gains.json", result)
            console.print("before:")
            before = verify_on(board, old, verification, out / "verify_before.csv", console)
            console.print("after:")
            after = verify_on(board, result.gains, verification, out / "verify_after.csv", console)
            report = write_report(out / "report.html", motors, result, old, before, after)
            keep = yes or typer.confirm("Save the new gains on the board?")
        except BaseException:  # Ctrl-C too: perhaps because the robot shakes with the new ones
            with suppress(ThumperError):
                write_gains(board, old)
            raise
        if keep:
            board.command(Command.SAVE)
        else:
            write_gains(board, old)
        console.print(
            ("the board has saved the new gains" if keep else "the board has its old gains again")
            + f"; {report} shows all"
        )
