"""Runs a `thumper` command for the page and collects what it prints."""

import asyncio
import os
import signal
import sys
from collections import deque
from contextlib import suppress

from thumper.common.parent import parent_environment
from thumper.dashboard.display_data import Row, open_loop_row

MAX_LINES = 200
END_TIMEOUT_S = 5.0  # the motors stop by themselves long before, if a command does not end
SPEEDS = "wheels "
ENVIRONMENT = {"NO_COLOR": "1", "PYTHONUNBUFFERED": "1", "COLUMNS": "1000"}  # one line stays one line


class StepCommand:
    """A command of a step."""

    def __init__(self, *arguments: str) -> None:
        self.arguments = arguments
        self.lines: deque[str] = deque(maxlen=MAX_LINES)
        self.rows: list[Row] = []  # of the charts, from the lines of `thumper doctor --speeds`
        self._process: asyncio.subprocess.Process | None = None
        self.is_interrupted = False

    @property
    def last_line(self) -> str:
        """The newest line, without the prefix of an error."""
        return self.lines[-1].removeprefix("thumper: ") if self.lines else ""

    @property
    def is_running(self) -> bool:
        """Whether it has started and not ended."""
        return self._process is not None and self._process.returncode is None

    async def run(self, answer: str = "") -> int:
        """Run it to its end; return its exit status. `answer` is what the user would type."""
        return await self._run(answer, {})

    async def run_in_background(self, end_timeout_s: float) -> int:
        """Do so with no answer; if this process dies, the command has `end_timeout_s` to end."""
        return await self._run(None, parent_environment(end_timeout_s))

    async def _run(self, answer: str | None, environment: dict[str, str]) -> int:
        self._process = process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "thumper", *self.arguments),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.STDOUT,
            env=os.environ | ENVIRONMENT | environment,
            start_new_session=True,  # Ctrl-C in the terminal reaches it once, through `stop`
        )
        if self.is_interrupted:
            self.interrupt()
        if process.stdin is not None and answer is not None:
            process.stdin.write(answer.encode())
            process.stdin.close()
        if process.stdout is not None:
            async for line in process.stdout:
                # A question that was answered stands before the line that follows it.
                text = line.decode(errors="replace").rpartition("[y/N] ")[2].strip()
                if text.startswith(SPEEDS):
                    time_s, *sides = text.split()[1:]
                    numbers = [int(number) for number in sides]
                    self.rows.append(open_loop_row(float(time_s), numbers[:3], numbers[3:]))
                elif text:
                    self.lines.append(text)
        return await process.wait()

    def interrupt(self) -> None:
        """Send it Ctrl-C: a command that drives stops the motors first."""
        self.is_interrupted = True
        if self._process is not None and self._process.returncode is None:
            with suppress(ProcessLookupError):
                self._process.send_signal(signal.SIGINT)

    async def stop(self, timeout_s: float = END_TIMEOUT_S) -> None:
        """Interrupt it and wait for its end; kill it after `timeout_s`."""
        self.interrupt()
        if self._process is None:
            return
        try:
            await asyncio.wait_for(self._process.wait(), timeout_s)
        except TimeoutError:
            with suppress(ProcessLookupError):
                self._process.kill()
            await self._process.wait()
