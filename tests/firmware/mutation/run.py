"""Does the desk suite notice? Builds the core once per mutant and runs the tests that need no chip.

python -m tests.firmware.mutation.run                  all of them (`make mutation`)
python -m tests.firmware.mutation.run --sample 20      a random few, by --seed
"""

import argparse
import os
import random
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.firmware.mutation.mutants import CORE, Mutant, mutants

REPO = Path(__file__).resolve().parents[3]
QUICK_FIRST = [
    "test_wheel",
    "test_supervisor",
    "test_monitors",
    "test_ramp_battery_units",
    "test_quadrature",
    "test_host_interface",
    "test_framing",
    "test_store",
    "test_law",
    "test_pi",
]
OWN = {
    "battery.hpp": "test_ramp_battery_units",
    "beep.hpp": "test_monitors",
    "config.hpp": "test_law",
    "crc.hpp": "test_framing",
    "feedforward.hpp": "test_law",
    "fixed.hpp": "test_law",
    "framing.hpp": "test_framing",
    "host_interface.hpp": "test_host_interface",
    "monitor.hpp": "test_monitors",
    "parameters.hpp": "test_store",
    "pi.hpp": "test_pi",
    "quadrature.hpp": "test_quadrature",
    "ramp.hpp": "test_ramp_battery_units",
    "store.hpp": "test_store",
    "supervisor.hpp": "test_supervisor",
    "units.hpp": "test_ramp_battery_units",
    "wheel.hpp": "test_wheel",
}
"""The test likeliest to notice goes first: pytest stops at the first failure."""
TIMEOUT_S = 120.0
"""A mutant that runs for ever is noticed too."""


def is_killed(mutant: Mutant) -> bool:
    """Build and test a copy of the firmware with this one change."""
    with tempfile.TemporaryDirectory() as scratch:
        tests = Path(scratch) / "tests" / "firmware"
        shutil.copytree(REPO / "firmware" / "core", Path(scratch) / "firmware" / "core")
        shutil.copytree(REPO / "tests" / "firmware", tests, ignore=shutil.ignore_patterns("build", "fuzz"))
        path = Path(scratch) / "firmware" / "core" / mutant.file
        path.write_text(mutant.apply(path.read_text(encoding="utf-8")), encoding="utf-8")
        own = OWN.get(mutant.file)
        suite = sorted(QUICK_FIRST, key=lambda name: name != own)  # stable: the others keep their order
        files = [str(tests / f"{name}.py") for name in suite]
        options = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--import-mode=importlib"]
        environment = os.environ | {"PYTHONPATH": f"{scratch}:{REPO / 'host'}"}
        try:
            result = subprocess.run(
                [sys.executable, "-m", "pytest", *options, "--rootdir", scratch, *files],
                cwd=scratch,
                env=environment,
                capture_output=True,
                timeout=TIMEOUT_S,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return True
        return result.returncode != 0


def survivors(chosen: list[Mutant], jobs: int) -> list[Mutant]:
    """Return the mutants that no test noticed."""
    with ThreadPoolExecutor(jobs) as pool:
        return [m for m, killed in zip(chosen, pool.map(is_killed, chosen), strict=True) if not killed]


def main() -> int:
    """Print the survivors and their share; fail below 90 % killed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sample", type=int, default=0, help="how many, 0 = all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    arguments = parser.parse_args()
    chosen = mutants()
    if arguments.sample:
        chosen = random.Random(arguments.seed).sample(chosen, arguments.sample)
    alive = survivors(chosen, arguments.jobs)
    for mutant in alive:
        line = (CORE / mutant.file).read_text(encoding="utf-8").splitlines()[mutant.line - 1]
        print(f"{mutant}    {line.strip()}")
    killed = len(chosen) - len(alive)
    print(f"{killed} of {len(chosen)} mutants killed, {100 * killed / len(chosen):.1f} %")
    return 0 if killed >= 0.9 * len(chosen) else 1


if __name__ == "__main__":
    sys.exit(main())
