"""Fixtures of the simulator's tests: small test firmwares, and a robot without noise."""

import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from thumper_hil.chip.robot_params import RobotParams

SOURCES = Path(__file__).parent / "avr"

BuildAvr = Callable[[str], Path]


@pytest.fixture(scope="session")
def build_avr(tmp_path_factory: pytest.TempPathFactory) -> BuildAvr:
    """Return a function that compiles `avr/NAME.c` and returns its ELF."""
    folder = tmp_path_factory.mktemp("avr")

    def build(name: str) -> Path:
        elf = folder / f"{name}.elf"
        if not elf.exists():
            flags = [
                "-mmcu=atmega328p",
                "-DF_CPU=16000000UL",
                "-std=gnu11",
                "-Os",
                "-Wall",
                "-Wextra",
                "-Werror",
            ]
            subprocess.run(["avr-gcc", *flags, SOURCES / f"{name}.c", "-o", elf], check=True)
        return elf

    return build


@pytest.fixture
def even_params() -> RobotParams:
    """Return a robot without noise and with equal sides, so that closed forms hold."""
    params = RobotParams.load()
    return replace(
        params,
        motor=replace(params.motor, noise_Nm=0.0, spread_ratio=0.0, unit_spread_ratio=0.0),
        body=replace(
            params.body,
            radius_spread_ratio=0.0,
            track_growth_s=0.0,
            track_spread_ratio=0.0,
            track_noise_ratio=0.0,
        ),
        encoder=replace(params.encoder, edge_error_counts=0.0),
    )
