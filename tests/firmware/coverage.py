"""What the desk tests run of the firmware's core: `python -m tests.firmware.coverage` (`make coverage`).

Clang counts lines, and both ways of every condition. It leaves with 1 unless all of them were run. Not
counted is what is no code on the desk: lines of braces, a switch's way past all its cases, and what the
compiler alone runs (`COMPILED`), which test_supervisor.py and the static_asserts themselves hold.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from tests.firmware.conftest import BUILD

COMPILED = {"IsEventOf", "MakeTransitions", "Complete", "Connected", "Safe", "Largest"}
"""constexpr functions that only static_asserts and constants call."""
NEVER = {"host_interface.hpp": "default:  // a message that the schema has"}
"""Kept for the day when a message is added to the schema and forgotten there."""
TESTS = sorted(
    path
    for path in Path(__file__).parent.glob("test_*.py")
    if re.search(r"core(_at_rate)?: (ctypes|Callable)", path.read_text(encoding="utf-8"))
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Count:
    """One file's lines, and ways out of its conditions as (line, column, way): whether it was run."""

    lines: dict[int, bool] = field(default_factory=dict)
    ways: dict[tuple[int, int, bool], bool] = field(default_factory=dict)


def measure() -> tuple[str, str]:
    """Run the tests on a core that counts; returns the lines in lcov's format, and the conditions as JSON."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"LLVM_PROFILE_FILE": f"{folder}/%p-%m.profraw"}
        command = [sys.executable, "-m", "pytest", "-q", "-n", "auto", *map(str, TESTS)]
        subprocess.run(command, env=environment, check=True)
        merged = f"{folder}/core.profdata"
        raw = map(str, Path(folder).glob("*.profraw"))
        subprocess.run(["llvm-profdata", "merge", "-sparse", *raw, "-o", merged], check=True)
        libraries = [f"-object={path}" for path in BUILD.glob("core*_counted.so")]
        export = ["llvm-cov", "export", f"-instr-profile={merged}", *libraries]
        lines, ways = (
            subprocess.run([*export, f"-format={kind}"], capture_output=True, text=True, check=True).stdout
            for kind in ("lcov", "text")
        )
        return lines, ways


def read(lcov: str, conditions: str) -> dict[str, Count]:
    """The counts of each header of the core, without what is no code."""
    counts: dict[str, Count] = {}
    branches = {file["filename"]: file["branches"] for file in json.loads(conditions)["data"][0]["files"]}
    for part in lcov.split("end_of_record"):
        path = re.search(r"^SF:(.*/core/(\w+\.hpp))$", part, re.MULTILINE)
        if path is None:
            continue
        source = Path(path[1]).read_text(encoding="utf-8").splitlines()
        left_out = set(_no_code(path[2], source))
        count = counts[path[2]] = Count()
        for line, hits in re.findall(r"^DA:(\d+),(\d+)", part, re.MULTILINE):
            if int(line) not in left_out:
                count.lines[int(line)] = int(hits) > 0
        for at, column, _, _, *hits in branches[path[1]]:  # a template's are there once for each use
            if at not in left_out and "switch (" not in source[at - 1]:
                for way in (True, False):
                    key = at, column, way
                    count.ways[key] = count.ways.get(key, False) or hits[0 if way else 1] > 0
    return counts


def _no_code(name: str, source: list[str]) -> Iterator[int]:
    """Lines, from 1, that are not counted."""
    inside = False
    for number, line in enumerate(source, start=1):
        function = re.match(r"constexpr .*?(\w+)\(.*\{$", line)
        inside = inside or (function is not None and function[1] in COMPILED)
        before = source[number - 2] if number > 1 else ""
        never = name in NEVER and (NEVER[name] in line or NEVER[name] in before)
        if inside or never or not line.strip(" {}();"):
            yield number
        inside = inside and line != "}"


def main() -> int:
    """Print a table and what was not run; returns the exit code."""
    counts = read(*measure())
    if not counts:
        raise SystemExit("no header of the core was counted")
    missed = 0
    print(f"{'firmware/core/':24} {'lines':>12} {'conditions':>12}")
    for name, count in sorted(counts.items()):
        lines, ways = (f"{sum(runs.values())}/{len(runs)}" for runs in (count.lines, count.ways))
        print(f"{name:24} {lines:>12} {ways:>12}")
        places = {line for line, run in count.lines.items() if not run}
        places |= {line for (line, _, _), run in count.ways.items() if not run}
        missed += len(places)
        for line in sorted(places):
            print(f"  not run, or not both ways: {name}:{line}")
    for what in ("lines", "ways"):
        runs = [run for count in counts.values() for run in getattr(count, what).values()]
        print(f"core, {what}: {sum(runs)} of {len(runs)}, {100.0 * sum(runs) / len(runs):.1f} %")
    print(f"left out: {', '.join(sorted(COMPILED))}, which only the compiler runs")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
