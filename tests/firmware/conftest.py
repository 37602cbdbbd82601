"""Builds the firmware's core for the host computer, once, and loads it as a ctypes library.

Every function of the library takes and returns plain ints (native/core_api.cpp), so ctypes needs no
declarations. THUMPER_MUTANT names a directory with a modified core to test instead (mutation/run.py). With
LLVM_PROFILE_FILE set, the core records its coverage (coverage.py).
"""

import ctypes
import os
import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
MUTANT = os.environ.get("THUMPER_MUTANT")
FIRMWARE = Path(MUTANT) if MUTANT else HERE.parents[1] / "firmware"
BUILD = FIRMWARE / "build" if MUTANT else HERE / "build"
# Abort on overflow, bad shifts and out-of-bounds indices: the chip would continue with a wrong number.
SANITIZE = ["-fsanitize=signed-integer-overflow,shift-exponent,bounds", "-fno-sanitize-recover=all"]
COUNT = ["-O0", "-fprofile-instr-generate", "-fcoverage-mapping"] if "LLVM_PROFILE_FILE" in os.environ else []


def run(command: list[str]) -> None:
    """Run a build step. If it fails, end the test session with its errors."""
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        pytest.exit(f"{' '.join(command)}\n{result.stderr}", returncode=1)


def build(target: Path, compiler: list[str], sources: list[Path], flags: list[str]) -> Path:
    """Compile unless the target is newer than the core, this directory and the sources."""
    inputs = [*FIRMWARE.glob("*/*.hpp"), *HERE.glob("*/*.?pp"), *sources, Path(__file__)]
    if target.exists() and target.stat().st_mtime > max(path.stat().st_mtime for path in inputs):
        return target
    BUILD.mkdir(exist_ok=True)
    partial = target.with_suffix(f".{os.getpid()}")  # several test workers may build at once
    run([*compiler, *map(str, sources), "-o", str(partial), *flags])
    partial.replace(target)
    return target


@pytest.fixture(scope="session")
def core_at_rate() -> Callable[[int], ctypes.CDLL]:
    """Return the core built for a control rate [Hz]."""
    flags = ["-std=c++14", "-fPIC", "-shared", f"-I{FIRMWARE}", f"-I{HERE}", f"-I{HERE / 'native'}"]
    if COUNT:
        flags += COUNT
    elif MUTANT:
        flags += ["-O0", *SANITIZE, "-fsanitize-trap=all"]
    else:
        flags += ["-O1", "-Wall", "-Wextra", "-Werror", *SANITIZE]

    @cache
    def at_rate(rate_Hz: int) -> ctypes.CDLL:
        target = BUILD / f"core{rate_Hz}{'_counted' if COUNT else ''}.so"
        rate = f"-DTHUMPER_CONTROL_RATE_HZ={rate_Hz}"
        compiler = ["clang++" if MUTANT or COUNT else "g++"]  # twice as fast
        return ctypes.CDLL(str(build(target, compiler, [HERE / "native/core_api.cpp"], [*flags, rate])))

    return at_rate


@pytest.fixture(scope="session")
def core(core_at_rate: Callable[[int], ctypes.CDLL]) -> ctypes.CDLL:
    """Return the core at 10 Hz, as flashed."""
    return core_at_rate(10)


def run_on_chip(name: str) -> bytes:
    """Return the output of avr/<name>.cpp on the emulated chip."""
    elf = build(
        BUILD / f"{name}.elf",
        ["avr-g++", "-mmcu=atmega328p", "-DF_CPU=16000000L"],
        [HERE / f"avr/{name}.cpp"],
        ["-std=gnu++14", "-Os", "-fno-exceptions", "-fno-rtti", f"-I{FIRMWARE}", f"-I{HERE}"],
    )
    runner = build(BUILD / "runner", ["gcc", "-O2"], [HERE / "avr/runner.c"], ["-lsimavr"])
    return subprocess.run([str(runner), str(elf)], capture_output=True, check=True).stdout


@pytest.fixture(scope="session")
def chip_vectors() -> bytes:
    """Return the results of native/vectors.hpp on the emulated chip."""
    return run_on_chip("vectors")


@pytest.fixture(scope="session")
def chip_encoder_walk() -> bytes:
    """Return the counts of the encoder interrupt and of the reference on the emulated chip."""
    return run_on_chip("encoder_walk")


@pytest.fixture(scope="session")
def chip_uart_walk() -> bytes:
    """Return the results of the serial port's interrupts and of the reference on the emulated chip."""
    return run_on_chip("uart_walk")
