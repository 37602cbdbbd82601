"""Measure cost and limits of the built firmware ELF on the simulated chip, next to other projects.

The other projects were measured in the same way: libsimavr, one instruction per step, plus four cycles of
interrupt response, gcc 5.4 -Os -flto. rosserial: float PI, Speeds and Twist in, odometry out. bridge:
joshnewans' ros_arduino_bridge (L298, pin-change encoders). A dash means not available or not measured.
"""

import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from thumper.board.framing import FrameDecoder, encode_frame
from thumper.board.messages import (
    PARAMETERS,
    Command,
    CommandRequest,
    GetParameter,
    Identify,
    Message,
    SetParameter,
    SetWheelSpeeds,
    Telemetry,
)
from thumper_hil.bench import DEFAULT_ELF
from thumper_hil.chip.chip import CPU_HZ
from thumper_hil.chip.edge_rate import max_edges_per_s
from thumper_hil.chip.instrumented_chip import TICK_VECTOR, InstrumentedChip
from thumper_hil.chip.native_library import CProbeReport
from thumper_hil.chip.robot_params import RobotParams

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

from tests.firmware.second_simulator.node import is_installed
from tests.firmware.second_simulator.test_same_frames import on_avr8js, on_simavr

FIRMWARE = DEFAULT_ELF.parents[1]
WITHOUT = {
    "gyroscope": (
        "app/main.cpp",
        '#include "board/mpu6050.hpp"',
        f'#include "{Path(__file__).with_name("firmware_no_gyroscope.hpp")}"',
    ),
    "accelerometer": ("board/trex.hpp", "kHasAccelerometer = true", "kHasAccelerometer = false"),
}
"""A sensor, and the file, text and replacement that leave it out of the build."""
PARAMETER = {"gyroscope": "gyroscope", "accelerometer": "tilt_limit"}
VECTORS = {3: "right edge", 5: "left edge", 11: "control tick", 14: "millisecond", 18: "receive", 19: "send"}
VECTORS |= {21: "analogue", 24: "I2C"}
LOAD_S = 3.0
FLOOD = 5
"""Requests per millisecond; together with the answers they fill the line in both directions."""


def pack(message: Message, sequence: int = 0) -> bytes:
    """Return a message as a frame."""
    return encode_frame(message.ID, sequence, message.pack())


def row(what: str, here: str, aim: str, peers: str) -> None:
    """Print one figure; "-" means no value."""
    name, _, unit = what.partition(" [")
    aim, peers = (text.replace("-", "", 1) if text == "-" else text for text in (aim, peers))
    source = "same simulator and compiler" if peers else ""
    figure(name.strip(), here, unit.rstrip("]"), aim=aim, peers=peers, source=source)


def size_of(elf: Path) -> tuple[int, int]:
    """Return flash and static SRAM [bytes]."""
    text = subprocess.run(["avr-size", "-A", elf], capture_output=True, text=True, check=True).stdout
    part = {name: int(size) for name, size in re.findall(r"^\.(\w+)\s+(\d+)", text, re.MULTILINE)}
    return part["text"] + part["data"], part["data"] + part["bss"] + part.get("noinit", 0)


def size_without(sensor: str) -> tuple[int, int]:
    """Return flash and static SRAM [bytes] of the firmware built without a sensor."""
    file, old, new = WITHOUT[sensor]
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "firmware"
        shutil.copytree(FIRMWARE, copy, ignore=shutil.ignore_patterns("build"))
        text = (copy / file).read_text(encoding="utf-8")
        if old not in text:
            raise ValueError(f"{file}: {old!r} is missing; update benchmarks/firmware.py")
        (copy / file).write_text(text.replace(old, new), encoding="utf-8")
        subprocess.run(["make", "-s", "-C", copy], check=True, capture_output=True)
        return size_of(copy / "build" / "thumper.elf")


def drive_with(sensors: set[str]) -> CProbeReport:
    """Drive both wheels in closed loop for LOAD_S with these sensors in use, without other requests."""
    chip = InstrumentedChip(DEFAULT_ELF, params=RobotParams.load(), seed=1)
    chip.run(CPU_HZ // 5)
    chip.fit_gyroscope()
    for spec in PARAMETERS:
        if spec.name in {PARAMETER[sensor] for sensor in sensors}:
            chip.send(pack(SetParameter(index=spec.index, value=1)))
    chip.run(chip.cycle + CPU_HZ)
    chip.send(pack(CommandRequest(command=Command.ARM)))
    with chip.probe() as probe:
        for _ in range(round(LOAD_S * 20)):
            chip.send(pack(SetWheelSpeeds(left=8000, right=6000)))
            probe.run(chip.cycle + CPU_HZ // 20)
        report: CProbeReport = probe.report()
    return report


def sensors() -> None:
    """Print what the optional sensors cost."""
    plain, (flash, sram) = drive_with(set()), size_of(DEFAULT_ELF)
    for sensor in WITHOUT:
        flash_without, sram_without = size_without(sensor)
        row(
            f"{sensor}: flash [bytes]",
            str(flash - flash_without),
            "<= 900" if sensor == "gyroscope" else "-",
            "-",
        )
        if sram != sram_without:
            row(f"{sensor}: static SRAM [bytes]", str(sram - sram_without), "-", "-")
        used = drive_with({sensor})
        per_ms = (used.awake - plain.awake) / (1000 * LOAD_S)
        row(f"{sensor}: processor cycles per millisecond", f"{per_ms:.0f}", "-", "-")
        ticks = used.vector[TICK_VECTOR].most, plain.vector[TICK_VECTOR].most
        row(f"{sensor}: cycles per control tick, with (without)", f"{ticks[0]} ({ticks[1]})", "-", "-")


def sizes() -> None:
    """Print flash and static SRAM."""
    flash, sram = size_of(DEFAULT_ELF)
    row("flash [bytes]", str(flash), "<= 12288", "bridge 6102, rosserial 15720, linorobot 24362")
    row("static SRAM [bytes]", str(sram), "<= 768", "bridge 338, rosserial 1099, linorobot 2572")


def load() -> None:
    """Measure both wheels in closed loop at full speed and reversing, line full in both directions."""
    chip = InstrumentedChip(DEFAULT_ELF, params=RobotParams.load(), seed=1)
    chip.run(CPU_HZ // 2)
    chip.send(pack(CommandRequest(command=Command.ARM)))
    with chip.probe() as probe:
        for millisecond in range(round(LOAD_S * 1000)):
            if millisecond % 50 == 0:
                sign = 1 if millisecond < 1500 else -1
                chip.send(pack(SetWheelSpeeds(left=sign * 17_000, right=sign * 17_000)))
                chip.send(pack(GetParameter(index=millisecond // 50 % 6)))
            chip.send(pack(Identify()) * FLOOD)
            probe.run(chip.cycle + CPU_HZ // 1000)
            chip.receive(chip.available)
        report = probe.report()
    edges = [report.vector[3], report.vector[5]]
    mean = [cost.cycles / cost.entries for cost in edges]
    maximum = max(cost.most for cost in edges)
    peers = "bridge 111, rosserial 123/140, Encoder 138-152, PinChangeInterrupt 284/313"
    row(
        "cycles per edge, left, right: mean (max)",
        f"{mean[1]:.0f}, {mean[0]:.0f} ({maximum})",
        "<= 75",
        peers,
    )
    tick = report.vector[TICK_VECTOR]
    row(
        "cycles per control tick, both wheels: mean (max)",
        f"{tick.cycles / tick.entries:.0f} ({tick.most})",
        "<= 1700",
        "bridge 3206",
    )
    where = source_of(report.interrupts_off_address)
    row("longest time with interrupts off [cycles]", str(report.interrupts_off), "<= 150", "-")
    print(f"  in {where}")
    late_us = max(report.tick_most - CPU_HZ / 10, CPU_HZ / 10 - report.tick_least) / CPU_HZ * 1e6
    row(
        "jitter of the control period [us]", f"{late_us:.1f}", "-", "rosserial, bridge: loop() polls millis()"
    )
    row("deepest stack [bytes]", str(report.deepest_stack), "-", "bridge 102, rosserial 270")
    share = report.awake / (LOAD_S * CPU_HZ)
    row("processor load while requests flood the line [%]", f"{100 * share:.1f}", "-", "-")
    print("\neach interrupt under this load, including response and RETI [cycles]:")
    for number, name in VECTORS.items():
        cost = report.vector[number]
        if cost.entries:
            print(f"  {name:14} min {cost.least:5}  mean {cost.cycles / cost.entries:7.1f}  max {cost.most}")
    print()


def source_of(address: int) -> str:
    """Return the function at a flash address, or the name of the vector there."""
    if address < 26 * 4:
        return f"vector {address // 4}, {VECTORS.get(address // 4, '')}"
    command = ["avr-addr2line", "-f", "-C", "-e", str(DEFAULT_ELF), hex(address)]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    return f"{lines[0]} ({Path(lines[1]).name})"


def telemetry() -> None:
    """Measure bytes and cycles of a telemetry frame on an otherwise silent link."""
    chip = InstrumentedChip(DEFAULT_ELF, params=RobotParams.load(), seed=1)
    chip.run(CPU_HZ)
    chip.receive(chip.available)
    with chip.probe() as probe:
        probe.run(chip.cycle + 3 * CPU_HZ)
        report, bursts = probe.report(), probe.tick_bursts()
    data = chip.receive(chip.available)
    frames = sum(frame.message_id == Telemetry.ID for frame in FrameDecoder().feed(data))
    send = report.vector[19]
    cycles = statistics.median(bursts) + send.cycles / frames
    row(
        "telemetry frame [bytes on the wire]",
        f"{len(data) / frames:.1f}",
        "-",
        "rosserial odometry 24 (no battery, set-points, PWM, currents)",
    )
    row("  cycles to pack and send it", f"{cycles:.0f}", "-", "rosserial 3381 to pack 24 bytes")


def control_law(flag: str, what: str, aim: str, peers: str) -> None:
    """Measure the cycles of one wheel's step, including call and return where the compiler kept them."""
    flags = (FIRMWARE / "platformio.ini").read_text().split("build_flags =")[1].split("[")[0].split()
    flags += ["-Os", "-flto", f"-I{FIRMWARE}", *flag.split()]
    with tempfile.TemporaryDirectory() as folder:
        elf = Path(folder) / "control.elf"
        command = [
            "avr-g++",
            "-mmcu=atmega328p",
            "-DF_CPU=16000000L",
            "-Os",
            "-flto",
            *flags,
            f"-I{FIRMWARE}",
            *flag.split(),
        ]
        subprocess.run([*command, Path(__file__).with_name("firmware_control.cpp"), "-o", elf], check=True)
        chip = InstrumentedChip(elf)
        with chip.probe() as probe:
            probe.run(CPU_HZ // 20)
            report = probe.report()
    row(what, f"{report.marked / report.marks:.0f} ({report.marked_most})", aim, peers)


def second_simulator() -> None:
    """Compare the frames that the image sends on two simulators of the chip under the same stimuli."""
    if not is_installed():
        row("frames equal on avr8js", "-", "-", "-")
        print("  avr8js is not installed; `make docs` installs it")
        return
    here, there = on_simavr(), on_avr8js()
    equal = sum(ours == theirs for ours, theirs in zip(here, there, strict=False))
    row("frames equal on avr8js", f"{equal} of {len(here)}", f"{len(here)} of {len(here)}", "-")


def main() -> None:
    """Print the table."""
    sizes()
    sensors()
    load()
    control_law(
        "-DMEASURE_PI",
        "cycles per PI step, mean (max)",
        "<= 300",
        "FastPID 859, float PI 880, bridge 1108, Arduino-PID 1411",
    )
    control_law("", "cycles per ramp + feed-forward + PI step, mean (max)", "-", "-")
    for share, what in ((0.0, "telemetry only"), (0.1, "700 requests/s"), (1.0, "line full both ways")):
        rate = max_edges_per_s(DEFAULT_ELF, line_share=share)
        row(
            f"lossless edges/s, {what}",
            str(rate),
            ">= 100000",
            "bridge 58200, rosserial 52600, PinChangeInterrupt 26400",
        )
    telemetry()
    second_simulator()


if __name__ == "__main__":
    main()
