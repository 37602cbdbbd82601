"""Finite domains of the core, enumerated whole against independent models. On demand, deeper:

python -m tests.firmware.core.test_enumerated     every sequence one event longer, 10^8 random streams
"""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.firmware.conftest import BUILD, FIRMWARE, HERE, build
from tests.variants import some_of

SOURCE = HERE / "native" / "enumerate.cpp"
DOMAINS = {
    "quadrature": ("quadrature", 4_194_304),
    "supervisor, five events": ("supervisor 5", 8_308_824),
    "host interface, six events": ("host 6", 8_108_730),
    "framing": ("framing", 2_538_496),
    "random streams": ("streams 100000", 100_000),
}
"""Arguments, and the number of cases."""
ON_DEMAND = ("supervisor 6", "host 7", "streams 100000000 1")

FAULTS = {
    "quadrature": (
        "core/quadrature.hpp",
        "if (low_-- == 0) --high_;",
        "if (--low_ == 0) --high_;",
    ),
    "supervisor 5": ("core/supervisor.hpp", "latched != Fault::kEStop);", "true);"),
    "host 5": (
        "core/host_interface.hpp",
        "    silence_ms_ = 0;\n  }\n\n  FrameDecoder",
        "  }\n\n  FrameDecoder",
    ),
    "framing": ("core/framing.hpp", "length_ >= kOverhead", "length_ >= 2"),
    "streams 100000": ("core/framing.hpp", "!broken_ && remaining_ == 0", "!broken_"),
}
"""For each domain a file of the firmware, a text and what replaces it."""


def program(firmware: Path, target: Path, optimize: str = "-O2") -> Path:
    """Build the enumeration of this firmware's core."""
    flags = ["-std=c++14", optimize, "-Wall", "-Wextra", "-Werror"]
    return build(target, ["g++"], [SOURCE], [*flags, f"-I{firmware}", f"-I{HERE}", f"-I{HERE / 'native'}"])


@pytest.mark.parametrize("domain", DOMAINS)
def test_every_case_agrees_with_the_model(domain: str) -> None:
    arguments, cases = DOMAINS[domain]
    command = [str(program(FIRMWARE, BUILD / "enumerate")), *arguments.split()]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (result.returncode, result.stdout) == (0, f"{cases}\n")


@pytest.mark.parametrize("arguments", some_of(FAULTS))
def test_an_injected_fault_is_found(arguments: str, tmp_path: Path) -> None:
    file, old, new = FAULTS[arguments]
    (tmp_path / "core").mkdir()
    for header in (FIRMWARE / "core").glob("*.hpp"):
        text = header.read_text(encoding="utf-8")
        if header.name == Path(file).name:
            assert text.count(old) == 1
            text = text.replace(old, new)
        (tmp_path / "core" / header.name).write_text(text, encoding="utf-8")
    faulty = program(tmp_path, tmp_path / "enumerate", "-O0")
    result = subprocess.run([faulty, *arguments.split()], capture_output=True, text=True, check=False)
    assert result.returncode == 1
    assert " after " in result.stdout


def main() -> int:
    """Run the large enumerations; return 1 at the first difference."""
    for arguments in ON_DEMAND:
        print(f"{arguments}: ", end="", flush=True)
        if subprocess.run(
            [program(FIRMWARE, BUILD / "enumerate"), *arguments.split()], check=False
        ).returncode:
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
