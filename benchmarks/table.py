"""Run the benchmarks and collect their figures (`make bench`).

Run: python benchmarks/table.py [NAME ...]

Each benchmark is a separate program with its own output. Each call of `figure()` becomes a row of
docs/results/benchmarks.md. With names, only these benchmarks run and only their rows change.
"""

import json
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
PAGE = HERE.parent / "docs" / "results" / "benchmarks.md"
MARK = "<!-- below: made by `make bench` -->\n"
BENCHMARKS: dict[str, tuple[str, ...]] = {
    "cli": ("",),
    "firmware": ("",),
    "link_noise": ("--frames 100000",),
    "sim": ("",),
    "sim_validation": ("",),
    "raycast": ("",),
    "lidar_noise": ("",),
    "lidar_models": ("",),
    "drive_train": ("--seeds 8",),
    "slip": ("--drives 20 --hours 0.2",),
    "gyroscope": ("",),
    "tuning": ("",),
    "slam": ("--method scan_match", "--method slam", "--method rbpf"),
    "warm_up": ("",),
    "slam_public": ("",),
    "slam_kidnapping": ("",),
    "slam_truth": ("--method scan_match",),
    "slam_lidars": ("--seeds 1 --method scan_match --range 4 30",),
    "slam_closed_loop": ("",),
    "localization_starts": ("--starts 10", "--starts 10 --moved 2"),
    "localization_logs": ("",),
    "localization_tracking": ("",),
    "navigation": ("",),
    "scaling": ("--check",),
    "large_map": ("",),
    "navigation_barn": ("--tracker cascade",),
    "navigation_people": ("--scenes 10",),
    "bus": ("",),
    "recording": ("",),
    "dashboard": ("", "--side 4000"),
    "page_load": ("",),
}
"""The options of each run, in the order of the table."""
HEAD = "| benchmark | what | ours | aim | others | load |\n" + "|---" * 6 + "|\n"


def run(name: str, options: str) -> tuple[list[dict[str, str]], bool]:
    """Run one benchmark; return its figures, and True if it succeeded."""
    command = [sys.executable, str(HERE / f"{name}.py"), *options.split()]
    print(f"== {' '.join(Path(part).name for part in command)}", flush=True)
    start_s = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        rows = Path(folder) / "rows"
        rows.touch()
        code = subprocess.run(
            command, env=os.environ | {"THUMPER_FIGURES": str(rows)}, check=False
        ).returncode
        figures = [json.loads(line) for line in rows.read_text(encoding="utf-8").splitlines()]
    print(f"== {name}: {time.monotonic() - start_s:.0f} s", flush=True)
    if code != 0:
        figures.append({"what": name, "ours": f"failed with status {code}"})
    return figures, code == 0


def line(name: str, figure: dict[str, str]) -> str:
    """Return a row of the table in Markdown. Call it right after the benchmark, for its load."""
    ours = f"{figure['ours']} {figure.get('unit', '')}".strip()
    peers, source = figure.get("peers", ""), figure.get("source", "")
    others = f"{peers} ({source})" if source else peers
    load = os.getloadavg()[0]
    return f"| {name} | {figure['what']} | {ours} | {figure.get('aim', '')} | {others} | {load:.1f} |"


def machine() -> str:
    """Describe this computer."""
    info = Path("/proc/cpuinfo")
    found = re.search(r"model name\s*: (.*)", info.read_text(encoding="utf-8")) if info.exists() else None
    processor = found[1].strip() if found else platform.machine()
    return f"{processor}, {os.cpu_count()} cores, Python {platform.python_version()}."


def main(names: list[str]) -> int:
    """Run the benchmarks, write the page, and return the exit code."""
    unknown = sorted(set(names) - set(BENCHMARKS))
    if unknown:
        print(f"unknown benchmark {unknown[0]!r}; choose from {', '.join(BENCHMARKS)}", file=sys.stderr)
        return 2
    text, _, made = PAGE.read_text(encoding="utf-8").partition(MARK)
    rows = {name: re.findall(rf"(?m)^\| {name} \|.*$", made) for name in BENCHMARKS}
    all_well = True
    for name in names or BENCHMARKS:
        rows[name] = []
        for options in BENCHMARKS[name]:
            figures, well = run(name, options)
            all_well &= well
            rows[name] += [line(name, figure) for figure in figures]
    table = "\n".join(row for name in BENCHMARKS for row in rows[name])
    PAGE.write_text(f"{text}{MARK}\n{machine()}\n\n{HEAD}{table}\n", encoding="utf-8")
    print(f"wrote {PAGE.relative_to(HERE.parent)}")
    return 0 if all_well else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
