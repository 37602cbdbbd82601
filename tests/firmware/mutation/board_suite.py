"""The tests of firmware/app and firmware/board on the emulated chip, for run.py."""

import os
import subprocess
from functools import cache
from pathlib import Path

import pytest

from tests.firmware.mutation.mutants import FIRMWARE
from tests.firmware.mutation.survivors import BROKEN, SAME_IMAGE
from tests.firmware.mutation.worker import Subject

TESTS = FIRMWARE.parent / "tests" / "firmware"
MAIN, PINS = "app/main.cpp", ("board/trex.hpp", "board/nano.hpp")
SUITE: dict[str, tuple[str, ...]] = {
    "board/test_guards.py": (),
    "board/test_second_board.py": (),
    "board/test_inputs.py": (MAIN, *PINS),
    "board/test_configure_first.py": (MAIN,),
    "board/test_bootloader.py": (MAIN, "board/reset.cpp", "board/watchdog.hpp", "board/motors.hpp"),
    "board/test_reversal.py": (MAIN, "board/motors.hpp", "board/beeper.hpp", "board/clock.hpp"),
    "board/test_accelerometer.py": (MAIN, "board/adc.hpp", *PINS),
    "board/test_gyroscope.py": (MAIN, "board/mpu6050.hpp"),
    "board/test_robot_parameters.py": (MAIN, "board/motors.hpp", "board/adc.hpp", *PINS),
    "board/test_power_cut.py": (MAIN, "board/eeprom.hpp"),
    "board/test_encoder_edge.py": ("board/encoder_edge.hpp",),
    "board/test_uart_interrupts.py": ("board/uart.hpp", "board/uart_interrupts.hpp"),
    "board/test_link_noise.py": (MAIN, "board/uart.hpp"),
    "board/test_budget.py": (MAIN, "board/adc.hpp", "board/clock.hpp", "board/mpu6050.hpp"),
    "board/test_edge_rate.py": ("board/encoders.hpp", "board/encoder_edge.hpp", "board/uart_interrupts.hpp"),
    "preemption/test_preemption.py": (
        MAIN,
        "board/beeper.hpp",
        "board/motors.hpp",
        "board/mpu6050.hpp",
        "board/tick.hpp",
        "board/uart.hpp",
    ),
}
"""The files in which a test can detect a change (none named: in all). The quick tests come first."""
OTHER_FIRMWARE = "finds_a_missing_guard"
"""Tests that change the firmware themselves."""


def suite_for(items: list[pytest.Item], file: str) -> list[pytest.Item]:
    """Return the tests that can detect a change in a file, those of few files first; of main.cpp in order."""
    files = {Path(name).stem: files for name, files in SUITE.items()}
    able = [name for name in files if not files[name] or file in files[name]]
    if file != MAIN:
        able.sort(key=lambda name: (name == "test_preemption", len(files[name]) or 2))
    chosen = [item for item in items if item.path.stem in able and OTHER_FIRMWARE not in item.name]
    return sorted(chosen, key=lambda item: able.index(item.path.stem))


def images(firmware: Path) -> list[bytes]:
    """Build the firmware of both boards and return their images; raise CalledProcessError."""
    for board in ("trex", "nano"):
        subprocess.run(["make", "-s", "-C", firmware, f"BOARD={board}"], check=True, capture_output=True)
    return [(firmware / "build" / name).read_bytes() for name in ("thumper.hex", "nano/thumper.hex")]


@cache
def unchanged_images() -> list[bytes]:
    """Return the images of the firmware as it is."""
    return images(FIRMWARE)


def prepare(firmware: Path) -> str:
    """Build a changed copy; return why no test is needed, or an empty string."""
    unchanged = unchanged_images()
    os.environ["MAKEFLAGS"] = r"CXX=avr-g++\ -w"  # a variable without use is no error here
    try:
        return SAME_IMAGE if images(firmware) == unchanged else ""
    except subprocess.CalledProcessError:
        return BROKEN


BOARD_SUBJECT = Subject(
    within=".",
    modules=[TESTS / name for name in SUITE],
    options=[],
    suite=suite_for,
    prepare=prepare,
    timeout_s=60,
)
