"""Measures the coverage of the firmware's core: `python -m tests.firmware.coverage` (`make coverage`).

Clang counts lines and both branches of every condition. The exit status is 1 unless all of them ran. Excluded
are lines without code in the host build (braces, the path past all cases of a switch) and functions that only
the compiler runs (`COMPILED`). The static_asserts themselves and test_supervisor.py cover those.
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
NEVER = {"host_interface.hpp": "default:  // unreachable while every message"}
"""Reached only if someone adds a message to the schema but no case for it."""
TESTS = sorted(
    path
    for path in Path(__file__).parent.glob("core/test_*.py")
    if re.search(r"core(_at_rate)?: (ctypes|Callable)", path.read_text(encoding="utf-8"))
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Count:
    """Lines of a file, and branches of its conditions as (line, column, branch): whether each ran."""

    lines: dict[int, bool] = field(default_factory=dict)
    branches: dict[tuple[int, int, bool], bool] = field(default_factory=dict)


def measure() -> tuple[str, str]:
    """Run the tests on an instrumented core; return the lines in lcov format and the branches as JSON."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"LLVM_PROFILE_FILE": f"{folder}/%p-%m.profraw"}
        command = [sys.executable, "-m", "pytest", "-q", "-n", "auto", *map(str, TESTS)]
        subprocess.run(command, env=environment, check=True)
        merged = f"{folder}/core.profdata"
        raw = map(str, Path(folder).glob("*.profraw"))
        subprocess.run(["llvm-profdata", "merge", "-sparse", *raw, "-o", merged], check=True)
        libraries = [f"-object={path}" for path in BUILD.glob("core*_counted.so")]
        export = ["llvm-cov", "export", f"-instr-profile={merged}", *libraries]
        lines, conditions = (
            subprocess.run([*export, f"-format={kind}"], capture_output=True, text=True, check=True).stdout
            for kind in ("lcov", "text")
        )
        return lines, conditions


def read(lcov: str, conditions: str) -> dict[str, Count]:
    """Return the counts of each header of the core, without lines that have no code."""
    counts: dict[str, Count] = {}
    by_file = {file["filename"]: file["branches"] for file in json.loads(conditions)["data"][0]["files"]}
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
        for at, column, _, _, *hits in by_file[path[1]]:  # a template's appear once per instance
            if at not in left_out and "switch (" not in source[at - 1]:
                for branch in (True, False):
                    key = at, column, branch
                    count.branches[key] = count.branches.get(key, False) or hits[0 if branch else 1] > 0
    return counts


def _no_code(name: str, source: list[str]) -> Iterator[int]:
    """Yield the lines, from 1, that are not counted."""
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
    """Print a table and everything that did not run; return the exit status."""
    counts = read(*measure())
    if not counts:
        raise SystemExit("no header of the core was measured")
    missed = 0
    print(f"{'firmware/core/':24} {'lines':>12} {'conditions':>12}")
    for name, count in sorted(counts.items()):
        lines, branches = (f"{sum(runs.values())}/{len(runs)}" for runs in (count.lines, count.branches))
        print(f"{name:24} {lines:>12} {branches:>12}")
        places = {line for line, run in count.lines.items() if not run}
        places |= {line for (line, _, _), run in count.branches.items() if not run}
        missed += len(places)
        for line in sorted(places):
            print(f"  not run, or not both branches: {name}:{line}")
    for what in ("lines", "branches"):
        runs = [run for count in counts.values() for run in getattr(count, what).values()]
        print(f"core, {what}: {sum(runs)} of {len(runs)}, {100.0 * sum(runs) / len(runs):.1f} %")
    print(f"excluded (only the compiler runs them): {', '.join(sorted(COMPILED))}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
