"""`thumper doctor`: check the computer and the robot, and say how to fix what fails."""

import json
import shutil
import sys
from collections.abc import Iterator
from dataclasses import asdict
from importlib.metadata import entry_points
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from thumper.cli.options.common import AsJson, BoardPort, ConfigFile, LidarPort
from thumper.cli.output.stderr_report import report_unused_ports
from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.doctor.check import Check

if TYPE_CHECKING:
    from thumper.board.board import TelemetrySample


def doctor(
    board: BoardPort = "",
    lidar: LidarPort = "",
    config: ConfigFile = None,
    seconds: Annotated[
        float, typer.Option(help="Duration of each link measurement, in seconds.", min=1.0, max=60.0)
    ] = 3.0,
    spin: Annotated[
        bool,
        typer.Option("--spin", help="Also turn each wheel slowly to check the encoders: WHEELS UP."),
    ] = False,
    speeds: Annotated[
        bool,
        typer.Option(
            "--speeds",
            help="With --spin, print a line per control cycle to stderr: time [s], then of the left and the "
            "right side speed [mrad/s], PWM and current [mA].",
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Check the computer and, with --board, --lidar or --config, the robot; say how to fix what fails.

    Exits with 4 if a check failed.

    Example: `thumper doctor --board /dev/ttyUSB0 --lidar /dev/ttyACM0`
    """
    if speeds and not spin:
        raise ThumperError("--speeds needs --spin, which turns the wheels", exit_code=EXIT_USAGE)
    checks = _checks(board, lidar, config, seconds, spin, speeds)
    if as_json:
        rows = [asdict(check) for check in checks]
        print(json.dumps({"checks": rows, "ok": all(row["verdict"] != "fail" for row in rows)}, indent=2))
        failed = any(row["verdict"] == "fail" for row in rows)
    else:
        failed = _print(checks)
    if failed:
        raise typer.Exit(4)


def _checks(
    board: str, lidar: str, config: Path | None, seconds: float, spin: bool, speeds: bool
) -> Iterator[Check]:
    from thumper.config.robot import device_ports, load_config, shared_port, with_ports
    from thumper.doctor.board_checks import check_board
    from thumper.doctor.host_checks import check_set_up
    from thumper.doctor.lidar_checks import check_lidar
    from thumper.doctor.sensor_checks import check_sensors
    from thumper.doctor.usb_ports import KNOWN_USB, all_simulated

    configured = load_config(config)
    settings = with_ports(configured, board=board, lidar=lidar)
    report_unused_ports(configured, settings)
    yield from _computer()
    named = list(device_ports(settings).values()) if config else [port for port in (board, lidar) if port]
    if not (named and all_simulated(named)):
        yield from _ports()
        yield from check_set_up(KNOWN_USB)
    sensor_checks = check_sensors(settings, seconds=seconds)
    if lidar or config or settings.lidar.port.startswith("sim:"):  # a simulated board brings its lidar
        sensor_checks = chain(check_lidar(settings.lidar, seconds=seconds), sensor_checks)
    if (board or config) and (shared := shared_port(settings)):  # a board must not get what a lidar is asked
        sensor_checks = iter([Check(verdict="fail", what="one port, two devices", fix=shared)])
    if board or config:
        yield from check_board(
            settings.board,
            seconds=seconds,
            spin=_consent if spin else None,
            also=sensor_checks,
            needs_gyroscope=settings.imu.uses_board,
            on_turning=_print_speeds if speeds else lambda sample: None,
        )
    else:
        yield from sensor_checks


def _print_speeds(sample: "TelemetrySample") -> None:
    """Print the line of `--speeds`, which the page of `thumper setup` draws."""
    t = sample.telemetry
    left = f"{t.left_speed} {t.left_pwm} {t.left_current_mA}"
    right = f"{t.right_speed} {t.right_pwm} {t.right_current_mA}"
    print(f"wheels {sample.time_s:.3f} {left} {right}", file=sys.stderr, flush=True)


def _consent() -> bool:
    # Not typer.confirm, which writes to stdout; stdout carries only the report.
    typer.echo("The wheels will turn. Is the robot on a stand, wheels in the air? [y/N] ", err=True, nl=False)
    return sys.stdin.readline().strip().lower() in {"y", "yes"}


def _print(checks: Iterator[Check]) -> bool:
    """Print each check as it completes; return whether one failed."""
    from rich.console import Console
    from rich.markup import escape

    console = Console(soft_wrap=True)
    style = {"pass": "green", "info": "cyan", "warn": "yellow", "fail": "red"}
    failed = False
    for check in checks:
        fix = f": {check.fix}" if check.fix else ""
        verdict = f"[{style[check.verdict]}]{check.verdict}[/]"
        console.print(f"{verdict}  {escape(check.what + fix)}", highlight=False)
        failed = failed or check.verdict == "fail"
    return failed


def _computer() -> Iterator[Check]:
    version = ".".join(map(str, sys.version_info[:3]))
    yield Check(verdict="pass" if sys.version_info >= (3, 11) else "fail", what=f"Python {version}")
    for plugin in entry_points(group="thumper.serial_protocols"):
        missing = plugin.load().missing_parts()
        ports = f"simulated ports {plugin.name}://"
        yield (
            Check(verdict="fail", what=ports, fix=missing) if missing else Check(verdict="pass", what=ports)
        )
    for tool, use in (("avr-gcc", "building the firmware"), ("avrdude", "flashing a board")):
        if shutil.which(tool):
            yield Check(verdict="pass", what=tool)
        else:
            package = {"avr-gcc": "gcc-avr avr-libc"}.get(tool, tool)
            yield Check(
                verdict="warn", what=f"{tool} not found", fix=f"needed for {use}: sudo apt install {package}"
            )


def _ports() -> Iterator[Check]:
    from thumper.doctor.usb_ports import usb_ports

    found = False
    for port in usb_ports():
        found = True
        what = f"{port.device}: {port.name}"
        try:
            with Path(port.device).open("rb"):
                pass
            yield Check(verdict="pass", what=what)
        except PermissionError:
            yield Check(verdict="fail", what=what, fix="no permission; run: sudo usermod -aG dialout $USER")
        except OSError:
            fix = "cannot be opened; close other programs that use it"
            yield Check(verdict="warn", what=what, fix=fix)
    if not found:
        yield Check(
            verdict="warn",
            what="no USB serial port",
            fix="plug in the board and the lidar, or use sim:// ports",
        )
