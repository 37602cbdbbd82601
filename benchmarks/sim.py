"""Measure how fast the simulated robot runs, and which part takes the time.

The limit is simavr's speed: a firmware that is awake for a known share of the cycles needs at least the time
of a busy loop for that share. The rest of the time goes to simavr's timers, motors, world, lidar and Python.
"""

import itertools
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from thumper.board.framing import encode_frame
from thumper.board.messages import Command, CommandRequest, SetWheelSpeeds
from thumper_hil.bench import DEFAULT_ELF, Bench
from thumper_hil.bench.options import BenchOptions
from thumper_hil.chip.chip import CPU_HZ, Chip
from thumper_hil.chip.robot_params import RobotParams

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

SIM_S = 10.0
RUNS = 5
"""Each figure is the best of this many runs, because other programs can only slow it down."""

COMMAND_PERIOD_S = 0.1
CIRCLE = SetWheelSpeeds(left=6000, right=3000)
FAST = SetWheelSpeeds(left=12000, right=12000)
REST = SetWheelSpeeds(left=0, right=0)
LIDAR_ON = b"BM\nMD0044072501000\n"


def busy_rate_Hz() -> float:
    """Return the cycles that simavr simulates per second of real time if the firmware never sleeps."""
    source = "#include <avr/io.h>\nint main(void) { for (;;) ++GPIOR0; }\n"
    with tempfile.TemporaryDirectory() as folder:
        elf = Path(folder) / "busy.elf"
        command = ["avr-gcc", "-mmcu=atmega328p", "-Os", "-x", "c", "-", "-o", str(elf)]
        subprocess.run(command, input=source.encode(), check=True)
        chip, best_Hz = Chip(elf), 0.0
        for _ in range(RUNS):
            start_s = time.perf_counter()
            chip.run(chip.cycle + CPU_HZ)
            best_Hz = max(best_Hz, CPU_HZ / (time.perf_counter() - start_s))
        return best_Hz


def drive(chip: Chip, command: SetWheelSpeeds, advance: Callable[[float], None]) -> float:
    """Arm and command the wheels for SIM_S; return the multiple of real time."""
    advance(0.1)
    arm = CommandRequest(command=Command.ARM)
    chip.send(encode_frame(arm.ID, 1, arm.pack()))
    start_s = time.perf_counter()
    for tick in range(round(SIM_S / COMMAND_PERIOD_S)):
        chip.send(encode_frame(command.ID, 2, command.pack()))
        advance(0.1 + (tick + 1) * COMMAND_PERIOD_S)
        chip.receive(4096)
    return SIM_S / (time.perf_counter() - start_s)


def drive_chip(command: SetWheelSpeeds, params: RobotParams | None) -> tuple[float, float]:
    """Drive the chip alone, with or without motors and encoders; return speed and processor load."""
    chip = Chip(DEFAULT_ELF, params=params, seed=1)

    def advance(until_s: float) -> None:
        chip.run(round(until_s * CPU_HZ))

    return drive(chip, command, advance), chip.cpu_load


def drive_bench(command: SetWheelSpeeds, *, lidar: bool) -> tuple[float, float]:
    """Drive the whole robot in a circle in the lab; return speed and processor load."""
    bench = Bench(BenchOptions(world="lab"))
    if lidar:
        bench.sensor_write("lidar", LIDAR_ON)

    def advance(until_s: float) -> None:
        bench.advance(until_s)
        bench.sensor_read("lidar", 1_000_000)

    return drive(bench.chip, command, advance), bench.chip.cpu_load


def main() -> None:
    """Print speed, processor load and limit of each configuration."""
    rate_Hz = busy_rate_Hz()
    params = RobotParams.load()
    drive_bench(CIRCLE, lidar=True)  # compiles or loads the kernels
    runs: tuple[tuple[str, Callable[[], tuple[float, float]]], ...] = (
        ("chip alone, armed", lambda: drive_chip(REST, None)),
        ("chip + motors, stationary", lambda: drive_chip(REST, params)),
        ("chip + motors, driving 6 and 3 rad/s", lambda: drive_chip(CIRCLE, params)),
        ("chip + motors, driving 12 rad/s", lambda: drive_chip(FAST, params)),
        ("robot in its world, driving a circle", lambda: drive_bench(CIRCLE, lidar=False)),
        ("whole robot with lidar, driving a circle", lambda: drive_bench(CIRCLE, lidar=True)),
    )
    stages = [(name, max(run() for _ in range(RUNS))) for name, run in runs]
    print(f"a firmware that never sleeps: {rate_Hz / 1e6:.0f} Mcycle/s, {rate_Hz / CPU_HZ:.1f} x real time\n")
    print(f"{'':42} {'x real time':>11} {'CPU load':>9} {'limit':>7} {'of limit':>9}")
    for name, (speed, cpu_load) in stages:
        limit = rate_Hz / CPU_HZ / cpu_load
        print(f"{name:42} {speed:11.0f} {cpu_load:9.1%} {limit:7.0f} {speed / limit:9.0%}")
    figure(f"simulator: {stages[-1][0]}", f"{stages[-1][1][0]:.0f}", "x real time", aim="> 1")
    figure("simulator: chip alone, a firmware that never sleeps", f"{rate_Hz / CPU_HZ:.1f}", "x real time",
           peers="avr8js 3.0", source="avr8js 0.21 on Node 20, a machine of the same kind")  # fmt: skip
    costs_s = [1.0 / speed for _, (speed, _) in (stages[0], stages[2], stages[4], stages[5])]
    shares = [costs_s[0], *(after - before for before, after in itertools.pairwise(costs_s))]
    parts = (
        "the firmware itself",
        "motors, encoders and their interrupts",
        "world and ground truth",
        "lidar",
    )
    print("\nshares of the time of the whole robot:")
    for name, cost_s in zip(parts, shares, strict=True):
        print(f"  {name:40} {cost_s / costs_s[-1]:6.0%}   {1e3 * cost_s:6.2f} ms per simulated second")


if __name__ == "__main__":
    main()
