"""Follow docs/tutorials/build.md on the emulated board with its boot loader, and time every step.

Run: .venv/bin/python -m tests.e2e.build_page CLONE

CLONE is a fresh clone of the repository. Each command is the page's own; only the two ports differ, and
the bus has a port of its own.
"""

import os
import pty
import re
import select
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from benchmarks.shared.live import END_WITH_PARENT, free_port, until

from thumper.bus.client import BusClient

EXIT_NO_ANSWER, EXIT_CHECK = 3, 4
PAGE = Path("docs/tutorials/build.md")
PORTS = {"/dev/ttyUSB0": "board", "/dev/ttyACM0": "lidar"}
FENCE = re.compile(r"^ *```(sh|console|toml)\n(.*?)^ *```$", re.DOTALL | re.MULTILINE)


def steps(markdown: str) -> list[str]:
    """Return the commands of the page in order, and `[...` for a configuration to write."""
    found = []
    for kind, body in FENCE.findall(markdown):
        lines = [line.strip() for line in body.splitlines()]
        if kind == "toml":
            found.append("\n".join(lines) + "\n")
        else:
            found += [line.removeprefix("$ ") for line in lines if kind == "sh" or line.startswith("$ ")]
    return found


class Keyboard(threading.Thread):
    """The operator's side of a terminal: repeats the held key, reads the screen."""

    def __init__(self, terminal: int) -> None:
        super().__init__(daemon=True)
        self.held = b""
        self.screen = ""
        self._terminal = terminal
        self._ended = threading.Event()
        self.start()

    def run(self) -> None:
        """Until `release()`."""
        while not self._ended.wait(0.05):
            if self.held:
                os.write(self._terminal, self.held)
            while select.select([self._terminal], [], [], 0)[0]:
                self.screen += os.read(self._terminal, 4096).decode(errors="replace")

    def release(self) -> None:
        """End the thread and close the terminal."""
        self._ended.set()
        self.join()
        os.close(self._terminal)


class Walk:
    """One walk along the page, in a copy of the repository."""

    def __init__(self, repository: Path, folder: Path) -> None:
        self.repository = repository
        self.folder = folder
        self.took_s: list[tuple[str, float]] = []
        self._address = f"127.0.0.1:{free_port()}"
        self._bus = f'[bus]\naddress = "{self._address}"\n'
        self._ending = ExitStack()
        commands = (repository / ".venv/bin", Path(sys.executable).parent, os.environ["PATH"])
        self._environment = os.environ | {"PATH": os.pathsep.join(map(str, commands))}
        self._config = folder / "bus.toml"
        self._config.write_text(self._bus)
        self._begun_s = time.monotonic()

    def run(self, command: str, answer: str = "", allowed: tuple[int, ...] = (0,)) -> str:
        """Run a command of the page to its end; return its output.

        On a busy computer the emulated board is late, as a board with a loose cable: then the command says so
        and is run again, at most twice.
        """
        for _ in range(3):
            done = subprocess.run(
                self._shell(command),
                cwd=self.folder,
                env=self._environment,
                input=answer,
                capture_output=True,
                text=True,
                check=False,
            )
            if done.returncode != EXIT_NO_ANSWER:
                break
        assert done.returncode in allowed, f"{command}\n{done.stdout}{done.stderr}"
        self.done(command)
        return done.stdout

    def done(self, step: str) -> None:
        """Note the time at which a step is done."""
        self.took_s.append((step, time.monotonic() - self._begun_s))
        print(f"{self.took_s[-1][1]:6.0f} s  {step}", flush=True)

    def write_config(self, text: str, name: str) -> None:
        """Write a configuration of the page, with the walk's bus."""
        (self.folder / name).write_text(text + self._bus)

    @contextmanager
    def robot(self, floor: str) -> Iterator[None]:
        """Connect the emulated robot, on the floor or on a stand."""
        command = f"thumper sim --board-pty board --lidar-pty lidar --reset-on-open --floor {floor}"
        process = self._start(command)
        try:
            until(lambda: (self.folder / "lidar").exists() or process.poll() is not None)
            assert process.poll() is None, command
            yield
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(30)

    def stop_test(self, run: str, teleop: str) -> str:
        """Hold a key and press Space, as step 5 says; return the status after it."""
        robot = self._start(f"{run} --config {self._config}", stdout=subprocess.PIPE)
        ours, theirs = pty.openpty()
        keyboard = Keyboard(ours)
        try:
            until(lambda: "is running on" in (robot.stdout.readline() if robot.stdout else ""))
            states = self._states()
            keys = self._start(f"{teleop} --no-gamepad --config {self._config}", stdin=theirs, stdout=theirs)
            until(lambda: "thumper" in keyboard.screen)  # a key that is held at the start does not count
            keyboard.held = b"r"
            until(lambda: states[-1:] == ["CLOSED_LOOP"])
            keyboard.held = b"i"
            until(lambda: states[-1] == "MANUAL")
            self.done(teleop)
            keyboard.held = b" "
            until(lambda: states[-1] == "FAULT")
            status = self.run(f"thumper status --config {self._config}")
            keys.send_signal(signal.SIGINT)
            keys.wait(60)
        finally:
            self._ending.close()
            robot.send_signal(signal.SIGINT)
            robot.wait(60)
            keyboard.release()
            os.close(theirs)
        return status

    def _states(self) -> list[str]:
        """Return a list that grows by the board's state in each message of the robot."""
        states: list[str] = []
        client = self._ending.enter_context(BusClient("thumper", self._address))
        client.subscribe("status", lambda status: states.append(status.board_state))
        return states

    def _shell(self, command: str) -> list[str]:
        for port, link in PORTS.items():
            command = command.replace(port, str(self.folder / link))
        return [*END_WITH_PARENT, "bash", "-c", command]

    def _start(
        self, command: str, stdin: int | None = None, stdout: int | None = None
    ) -> "subprocess.Popen[str]":
        command = f"exec {command}".replace("-pty ", f"-pty {self.folder}/")
        return subprocess.Popen(
            self._shell(command),
            cwd=self.folder,
            env=self._environment,
            stdin=stdin,
            stdout=stdout,
            text=True,
        )


def follow(walk: Walk, *, whole: bool) -> None:
    """Do what the page says up to the first motion on the floor, and check each step.

    Without `whole`, leave out the set-up, and the manual stop: a busy computer is too slow for its keyboard.
    """
    _, terminal = (walk.repository / PAGE).read_text(encoding="utf-8").split("same in the terminal.")
    todo = steps(terminal)
    demo, _, doctor, flash, spin, run, teleop, slow, first = todo[:9]
    if whole:
        walk.run(f"{demo} -C {walk.repository}")
    assert "udev" in walk.run(doctor)
    with walk.robot("stand"):
        assert "written and verified\nfirmware 0." in walk.run(flash)
        report = walk.run(spin, answer="y\n", allowed=(0, EXIT_CHECK))  # a busy computer fails its timing
        for side in ("left", "right"):
            assert re.search(rf"pass .*{side} motor forward: {side} encoder \+\d\d", report), report
        if whole:
            assert "emergency stop was pressed" in walk.stop_test(run, teleop)
    assert "v_max_m_s = 0.2" in slow
    walk.write_config(slow, "slow.toml")
    with walk.robot("wood"):
        assert "reached: at the goal" in walk.run(first)


def main() -> None:
    """Walk in the clone; every step prints when it was done."""
    os.environ.pop("PYTHONPATH", None)  # of this repository, not of the clone
    with tempfile.TemporaryDirectory() as folder:
        walk = Walk(Path(sys.argv[1]).resolve(), Path(folder))
        follow(walk, whole=True)


if __name__ == "__main__":
    main()
