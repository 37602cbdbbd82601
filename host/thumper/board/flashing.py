"""Flash a board through its boot loader with avrdude or PlatformIO. Every failure becomes one line."""

import re
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from thumper.common.errors import EXIT_CHECK_FAILED, EXIT_NOT_THERE, EXIT_USAGE, ThumperError
from thumper.common.serial_port import no_such_port

FIRMWARE = Path(__file__).resolve().parents[3] / "firmware"
UPLOAD_BAUD = {"old": 57_600, "new": 115_200}
PROBE_TIMEOUT_S = 8.0  # a boot loader answers within 2 s of the reset; avrdude alone tries for a minute
FLASH_TIMEOUT_S = 120.0
NO_SYNC = re.compile(r"not in sync|not responding|can't? ?sync|timeout communicating|bad cmd", re.IGNORECASE)
NO_PORT = re.compile(
    r"can'?t open device|cannot open|could not open|no such file|inappropriate ioctl", re.IGNORECASE
)
BUSY = re.compile(r"permission denied|resource busy|locked", re.IGNORECASE)
MISMATCH = re.compile(r"verification error|content mismatch|doesn't match", re.IGNORECASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class FlashJob:
    """The firmware file, and the board and port to write it to."""

    port: str
    hex_file: Path
    board: str  # an environment of platformio.ini
    bootloader: str  # a key of UPLOAD_BAUD

    @property
    def upload_baud(self) -> int:
        """Baud rate of the boot loader."""
        return UPLOAD_BAUD[self.bootloader]


def flash_board(job: FlashJob, *, tool: str, report: Callable[[str], None] = lambda _: None) -> None:
    """Write and verify the firmware; `tool` is avrdude, pio or auto.

    `report` gets a line when it begins, then avrdude's progress per 20 %, or each line of PlatformIO.

    Raises
    ------
    ThumperError
        The tool, HEX file or port is missing, the boot loader does not answer or answers at the other baud
        rate, or the verification fails.
    """
    tool, executable = _find_tool(tool)
    if tool == "avrdude" and not job.hex_file.is_file():
        build = "make firmware" if job.board == "trex" else f"make -C firmware BOARD={job.board}"
        raise ThumperError(f"{job.hex_file}: no firmware file; run `{build}`", exit_code=EXIT_CHECK_FAILED)
    if not Path(job.port).exists():
        raise no_such_port(job.port, "board")
    if tool == "pio":
        environment = job.board + ("" if job.bootloader == "old" else "_new")
        command = [executable, "run", "-d", str(FIRMWARE), "-e", environment, "-t", "upload"]
        command += ["--upload-port", job.port]
    else:
        probe = _avrdude(executable, job.port, job.upload_baud)
        status, output = _run(probe, PROBE_TIMEOUT_S)
        if status != 0:
            raise _explain(job, tool, executable, output)
        command = [argument for argument in probe if argument != "-q"]  # quiet, avrdude shows no progress
        command += ["-U", f"flash:w:{job.hex_file}:i"]
    report(f"flashing {_short(job.hex_file)} to {job.port} at {job.upload_baud} baud")
    progress = _last_line if tool == "pio" else _avrdude_progress
    status, output = _write(command, FLASH_TIMEOUT_S, progress, report)
    if status != 0:
        raise _explain(job, tool, executable, output)


def _short(path: Path) -> Path:
    """Return the path as seen from the working folder, if it is inside that."""
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path


def _find_tool(wanted: str) -> tuple[str, str]:
    tools = ("avrdude", "pio") if wanted == "auto" else (wanted,)
    if not FIRMWARE.is_dir():  # PlatformIO builds from the sources, which an installed wheel does not contain
        if wanted == "pio":
            raise ThumperError(
                "PlatformIO needs the firmware sources; run the command in a clone of the repository",
                exit_code=EXIT_USAGE,
            )
        tools = ("avrdude",)
    beside_python = str(Path(sys.executable).parent)  # pip installs PlatformIO there in a virtual environment
    for tool in tools:
        executable = shutil.which(tool) or shutil.which(tool, path=beside_python)
        if executable:
            return tool, executable
    raise ThumperError(
        f"not installed: {', '.join(tools)}; run `sudo apt install avrdude`", exit_code=EXIT_CHECK_FAILED
    )


def _avrdude(executable: str, port: str, baud: int) -> list[str]:
    # -D: a boot loader erases page by page, not the whole chip. avrdude verifies without being asked to.
    return [executable, "-q", "-c", "arduino", "-p", "m328p", "-P", port, "-b", str(baud), "-D"]


def _run(command: list[str], timeout_s: float) -> tuple[int, str]:
    try:
        result = subprocess.run(
            command, capture_output=True, text=True, errors="replace", timeout=timeout_s, check=False
        )
    except subprocess.TimeoutExpired:
        return 1, "timeout communicating with programmer"
    return result.returncode, result.stdout + result.stderr


def _write(
    command: list[str], timeout_s: float, progress: Callable[[str], str], report: Callable[[str], None]
) -> tuple[int, str]:
    """Run the tool, and report what `progress` finds in its output so far."""
    output = ""
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace"
    ) as process:
        assert process.stdout is not None
        timer = threading.Timer(timeout_s, process.kill)
        timer.start()
        try:
            while letter := process.stdout.read(1):
                output += letter
                if line := progress(output):
                    report(line)
        except BaseException:
            process.kill()
            raise
        finally:
            expired = not timer.is_alive()
            timer.cancel()
    return (1, "timeout communicating with programmer") if expired else (process.returncode, output)


def _avrdude_progress(output: str) -> str:
    """Return the share at each fifth: avrdude draws 50 `#` for each of writing and verifying."""
    _, writing, after = output.partition("Writing | ")  # before it, some read a signature
    length = len(output) - len(output.rstrip("#"))
    if not writing or length == 0 or length % 10 != 0:
        return ""
    return f"{'verifying' if 'Reading | ' in after else 'writing'}: {2 * length} %"


def _last_line(output: str) -> str:
    """Return the line that has just ended."""
    return output[:-1].rpartition("\n")[2] if output.endswith("\n") else ""


def _explain(job: FlashJob, tool: str, executable: str, output: str) -> ThumperError:
    if MISMATCH.search(output):
        return ThumperError(
            f"{job.port}: the verification failed; flash again. If it fails again, the chip is worn out"
        )
    if BUSY.search(output):
        return ThumperError(
            f"{job.port}: busy or permission denied; close the program that uses it, "
            "or run `sudo usermod -aG dialout $USER`",
            exit_code=EXIT_NOT_THERE,
        )
    if NO_PORT.search(output):
        return ThumperError(f"{job.port}: cannot be opened as a serial port", exit_code=EXIT_NOT_THERE)
    if NO_SYNC.search(output):
        return _explain_silence(job, tool, executable)
    lines = [line.strip() for line in output.splitlines() if line.strip() and "avrdude done" not in line]
    return ThumperError(f"{job.port}: {tool} failed: {lines[-1] if lines else 'no output'}")


def _explain_silence(job: FlashJob, tool: str, executable: str) -> ThumperError:
    """Return the error for no answer, after a probe at the other boot loader's baud rate."""
    other = "new" if job.bootloader == "old" else "old"
    probe = _avrdude(executable, job.port, UPLOAD_BAUD[other])
    if tool == "avrdude" and _run(probe, PROBE_TIMEOUT_S)[0] == 0:
        return ThumperError(
            f"{job.port}: the boot loader answers at {UPLOAD_BAUD[other]} baud, not at "
            f"{job.upload_baud}; flash with --bootloader {other}",
            exit_code=EXIT_NOT_THERE,
        )
    return ThumperError(
        f"{job.port}: no boot loader answers; is it the right port, and is the board powered?",
        exit_code=EXIT_NOT_THERE,
    )
