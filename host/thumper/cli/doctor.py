"""`thumper doctor`: what is missing on this computer, and how to get it."""

import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import Annotated, Literal

import typer

KNOWN_USB = {
    (0x15D1, 0x0000): "Hokuyo lidar",
    (0x10C4, 0xEA60): "CP210x (T'REX board)",
    (0x1A86, 0x7523): "CH340 (Nano clone)",
    (0x0403, 0x6001): "FTDI (Nano)",
}


@dataclass(frozen=True, slots=True)
class Check:
    """One line of the report."""

    verdict: Literal["pass", "warn", "fail"]
    what: str
    cure: str = ""


def doctor(
    board: Annotated[str, typer.Option(help="Also shake hands with the board on this port or URL.")] = "",
    lidar: Annotated[str, typer.Option(help="Also take a scan from the lidar on this port or URL.")] = "",
) -> None:
    """Check this computer, and with --board and --lidar the robot; say how to mend what is missing."""
    from rich.console import Console
    from rich.markup import escape

    checks = [*_computer(), *_ports()]
    if board:
        checks.append(_board(board))
    if lidar:
        checks.append(_lidar(lidar))
    console = Console()
    style = {"pass": "green", "warn": "yellow", "fail": "red"}
    for check in checks:
        cure = f": {check.cure}" if check.cure else ""
        console.print(
            f"[{style[check.verdict]}]{check.verdict}[/]  {escape(check.what + cure)}", highlight=False
        )
    if any(check.verdict == "fail" for check in checks):
        raise typer.Exit(4)


def _computer() -> Iterator[Check]:
    version = ".".join(map(str, sys.version_info[:3]))
    yield Check("pass" if sys.version_info >= (3, 11) else "fail", f"Python {version}")
    for plugin in entry_points(group="thumper.serial_protocols"):
        missing = plugin.load().missing_parts()
        ports = f"simulated ports {plugin.name}://"
        yield Check("fail", ports, missing) if missing else Check("pass", ports)
    for tool, use in (("avr-gcc", "building the firmware"), ("avrdude", "flashing a board")):
        if shutil.which(tool):
            yield Check("pass", tool)
        else:
            package = {"avr-gcc": "gcc-avr avr-libc"}.get(tool, tool)
            yield Check("warn", f"{tool} not found", f"needed for {use}: sudo apt install {package}")


def _ports() -> Iterator[Check]:
    from serial.tools.list_ports import comports

    found = False
    for port in comports():
        if port.vid is None:
            continue
        found = True
        name = KNOWN_USB.get((port.vid, port.pid), port.description)
        try:
            with Path(port.device).open("rb"):
                pass
            yield Check("pass", f"{port.device}: {name}")
        except PermissionError:
            yield Check("fail", f"{port.device}: {name}", "not permitted: sudo usermod -aG dialout $USER")
        except OSError:
            yield Check("warn", f"{port.device}: {name}", "cannot be opened; is another program using it?")
    if not found:
        yield Check("warn", "no USB serial port", "plug in board and lidar, or use sim:// ports")


def _board(url: str) -> Check:
    from thumper.errors import ThumperError
    from thumper.link.board import Board

    try:
        robot = Board.open(url, baud=500_000)
    except ThumperError as error:
        return Check("fail", "board", str(error))
    try:
        samples = robot.poll(0.5)
    finally:
        robot.close()
    if not samples:
        return Check("fail", "board", f"{url} shakes hands but sends no telemetry; flash the firmware again")
    battery_V = samples[-1].telemetry.battery_mV / 1000
    i = robot.identity
    version = f"{i.version_major}.{i.version_minor}.{i.version_patch}"
    report = f"board {url}: firmware {version}, {i.control_rate_Hz} Hz, battery {battery_V:.2f} V"
    return Check("pass", report) if battery_V > 7.0 else Check("warn", report, "charge the battery")


def _lidar(url: str) -> Check:
    from thumper.errors import ThumperError
    from thumper.lidar.urg04lx import Urg04LxDriver

    try:
        with Urg04LxDriver.open(url, baud=115_200) as sensor:
            scan = sensor.wait_for_scan(timeout_s=2.0)
    except ThumperError as error:
        return Check("fail", "lidar", str(error))
    return Check("pass", f"lidar {url}: {scan.ranges_m.size} beams")
