"""Follow docs/tutorials/build.md on the emulated board with its boot loader, and time every step.

Run: .venv/bin/python -m tests.e2e.build_page CLONE

CLONE is a fresh clone of the repository. Each command is the page's own; only the two ports differ, and
the bus has a port of its own. Speeds and stops are those of the bench's ground truth, in simulated time.
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

import numpy as np
from benchmarks.shared.live import END_WITH_PARENT, free_port, until

from thumper.board.messages import Fault
from thumper.bus.client import BusClient
from thumper.common.geometry import FloatArray
from thumper.ros.status import Status

EXIT_NO_ANSWER, EXIT_CHECK = 3, 4
PAGE = Path("docs/tutorials/build.md")
SIMULATOR = Path(__file__).with_name("recorded_sim.py")
LIMIT_S = 600.0  # from a clean clone to the first motion on the floor
STILL_RAD_S = 0.2
CABLE_S = 3.0  # without the cable; the board waits 0.3 s for a command
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
            commands = [line.removeprefix("$ ") for line in lines if kind == "sh" or line.startswith("$ ")]
            found += [command for command in commands if not command.startswith("#")]
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
        """Write a configuration of the page, with the walk's ports and bus."""
        (self.folder / name).write_text(self._with_ports(text) + self._bus)

    @contextmanager
    def robot(self, floor: str) -> Iterator[list[FloatArray]]:
        """Connect the emulated robot, on the floor or on a stand; when it is gone, the list has its truth."""
        truth = self.folder / f"{floor}.npy"
        options = f"--board-pty board --lidar-pty lidar --reset-on-open --floor {floor}"
        process = self._start(f"python {SIMULATOR} {truth} {options}")
        rows: list[FloatArray] = []
        try:
            until(lambda: (self.folder / "lidar").exists() or process.poll() is not None)
            assert process.poll() is None, options
            yield rows
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(30)
        rows.append(np.load(truth))

    def stop_test(self, run: str, teleop: str) -> str:
        """Arm, drive, release, drive, stop, clear and lose the cable, as step 5 says.

        Returns the status after the stop. A process that is halted sends as little as a cable that is pulled.
        """
        robot = self._start(run, stdout=subprocess.PIPE)
        ours, theirs = pty.openpty()
        keyboard = Keyboard(ours)
        try:
            until(lambda: "is running on" in (robot.stdout.readline() if robot.stdout else ""))
            robots = self._robots()
            keys = self._start(f"{teleop} --no-gamepad --config {self._config}", stdin=theirs, stdout=theirs)
            until(lambda: "| keyboard" in keyboard.screen)  # a key that is held at the start does not count

            def hold(key: bytes, state: str, fault: Fault = Fault.NONE) -> None:
                """Hold a key until the board or the robot is in a state, through faults of late commands."""

                def is_there() -> bool:
                    now = robots[-1]
                    there = state in (now.board_state, now.mode) and now.fault == fault
                    is_late = now.fault not in (Fault.NONE, fault)
                    again = b"c" if is_late else b"r" if now.board_state == "DISARMED" else key
                    keyboard.held = key if there or key == b"c" else again
                    return there

                until(lambda: bool(robots) and is_there())

            hold(b"r", "CLOSED_LOOP")
            for key, state in ((b"i", "manual"), (b"", "holding"), (b"i", "manual")):
                hold(key, state)
                time.sleep(0.5)  # let the wheels reach their speed, or stop
            self.done(teleop)
            hold(b" ", "FAULT", Fault.E_STOP)
            status = self.run(f"thumper status --config {self._config}")
            hold(b"c", "DISARMED")
            hold(b"r", "CLOSED_LOOP")
            hold(b"i", "manual")
            time.sleep(0.5)
            robot.send_signal(signal.SIGSTOP)
            time.sleep(CABLE_S)
            keyboard.held = b"q"
            robot.send_signal(signal.SIGCONT)
            until(lambda: keys.poll() is not None)
        finally:
            self._ending.close()
            robot.send_signal(signal.SIGINT)
            robot.wait(60)
            keyboard.release()
            os.close(theirs)
        return status

    def _robots(self) -> list[Status]:
        """Return a list that grows by the status in each message of the robot."""
        received: list[Status] = []
        client = self._ending.enter_context(BusClient("thumper", self._address))
        client.subscribe("status", received.append)
        return received

    def _with_ports(self, text: str) -> str:
        for port, link in PORTS.items():
            text = text.replace(port, str(self.folder / link))
        return text

    def _shell(self, command: str) -> list[str]:
        return [*END_WITH_PARENT, "bash", "-c", self._with_ports(command)]

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


def stops(truth: FloatArray) -> list[tuple[float, float, float]]:
    """Return of each motion of the wheels its top speed [rad/s], its time and the time to stop [s]."""
    time_s, speed = truth[:, 0], np.abs(truth[:, 4:6]).max(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], speed > STILL_RAD_S, [0]))))
    found = []
    for begin, end in edges.reshape(-1, 2):
        top = float(speed[begin:end].max())
        last_fast = begin + np.flatnonzero(speed[begin:end] > 0.8 * top)[-1]
        stop_s = time_s[end - 1] - time_s[last_fast]
        found.append((top, float(time_s[end - 1] - time_s[begin]), float(stop_s)))
    return found


def top_speed_m_s(truth: FloatArray, window: int = 20) -> float:
    """Return the highest speed on the floor, as the mean over a window of samples."""
    moved_m = np.hypot(*(truth[window:, 1:3] - truth[:-window, 1:3]).T)
    return float((moved_m / (truth[window:, 0] - truth[:-window, 0])).max())


def follow(walk: Walk, *, with_setup: bool) -> None:
    """Do what the page says up to the first motion on the floor, and check each step."""
    _, terminal = (walk.repository / PAGE).read_text(encoding="utf-8").split("same in the terminal.")
    todo = steps(terminal)
    _clone, demo, _activate, doctor, config, flash, spin, run, teleop, first = todo[:10]
    if with_setup:
        walk.run(f"{demo} -C {walk.repository}")
    assert "udev" in walk.run(doctor)
    assert "v_max_m_s = 0.2" in config
    walk.write_config(config, "robot.toml")
    with walk.robot("stand") as stand:
        assert "written and verified\nfirmware 0." in walk.run(flash)
        report = walk.run(spin, answer="y\n", allowed=(0, EXIT_CHECK))  # a busy computer fails its timing
        assert f"lidar {walk.folder / 'lidar'}: " in report, report
        for side in ("left", "right"):
            assert re.search(rf"pass .*{side} motor forward: {side} encoder \+\d\d", report), report
        assert "emergency stop was pressed" in walk.stop_test(run, teleop)
    motions = stops(stand[0])
    assert len(motions) >= 5, motions  # each side in the check, and three times by keyboard
    (stopped_from, _, stop_s), (cut_from, cut_s, _) = motions[-2:]  # the emergency stop, and the pulled cable
    assert min(stopped_from, cut_from) > 2.0, motions
    assert stop_s < 0.5, motions
    assert cut_s < CABLE_S, motions
    with walk.robot("wood") as floor:
        assert "\nat the goal" in walk.run(first)
    speed_m_s = top_speed_m_s(floor[0])
    away_m = float(np.hypot(*(floor[0][-1, 1:3] - floor[0][0, 1:3])))
    print(f"on the floor: {speed_m_s:.3f} m/s at most, {away_m:.2f} m")
    print(f"emergency stop: wheels at rest after {stop_s:.2f} s; without its cable it drove {cut_s:.2f} s")
    assert 0.17 < speed_m_s < 0.23
    assert 0.4 < away_m < 0.6
    took_s = walk.took_s[-1][1]
    assert took_s < LIMIT_S, f"{took_s:.0f} s to the first motion on the floor; at most {LIMIT_S:.0f} s"


def main() -> None:
    """Walk in the clone; every step prints when it was done."""
    os.environ.pop("PYTHONPATH", None)  # of this repository, not of the clone
    with tempfile.TemporaryDirectory() as folder:
        walk = Walk(Path(sys.argv[1]).resolve(), Path(folder))
        follow(walk, with_setup=True)


if __name__ == "__main__":
    main()
