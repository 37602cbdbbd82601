"""Run the benchmarks and collect their figures (`make bench`).

Run: python benchmarks/table.py [NAME ...]

Each benchmark is a separate program with its own output. Each call of `figure()` becomes a row of a page in
docs/results/benchmarks/, the most important ones also of docs/results/benchmarks.md. With names, only these
benchmarks run and only their rows change.
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
PAGES = PAGE.with_suffix("")
MARK = "<!-- below: made by `make bench` -->\n"
BENCHMARKS: dict[str, tuple[str, ...]] = {
    "cli": ("",),
    "firmware": ("",),
    "link_noise": ("--frames 100000",),
    "sim": ("",),
    "campaign": ("",),
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
    "slam_truth": ("--method scan_match", "--method slam"),
    "slam_lidars": ("--seeds 1 --method scan_match --range 4 30",),
    "slam_closed_loop": ("",),
    "localization_starts": ("--starts 10", "--starts 10 --moved 2"),
    "localization_logs": ("",),
    "localization_tracking": ("",),
    "navigation": ("",),
    "scaling": ("--check",),
    "large_map": ("",),
    "navigation_barn": ("--presets nominal hard --scales 0.61 0.55",),
    "navigation_people": ("--presets nominal hard --scenes 10 --first 6000",),
    "navigation_walls": ("--rooms 30", "--rooms 30 --preset hard"),
    "navigation_time": ("--houses 12 --missions 6",),
    "exploration": ("--houses 10",),
    "bus": ("",),
    "recording": ("",),
    "dashboard": ("", "--side 4000"),
    "page_load": ("",),
}
"""The options of each run, in the order of the table."""
AREAS: dict[str, tuple[str, tuple[str, ...]]] = {
    "firmware": ("Firmware and serial link", ("firmware", "link_noise")),
    "simulator": ("Simulator", ("sim", "campaign", "sim_validation", "raycast", "lidar_noise")),
    "wheels": ("Wheels and odometry", ("tuning", "drive_train", "slip", "gyroscope")),
    "mapping": (
        "Mapping",
        (
            "slam",
            "slam_public",
            "slam_truth",
            "slam_lidars",
            "slam_closed_loop",
            "slam_kidnapping",
            "warm_up",
        ),
    ),
    "localization": (
        "Localization",
        ("localization_starts", "localization_logs", "localization_tracking"),
    ),
    "navigation": (
        "Navigation",
        (
            "navigation",
            "navigation_barn",
            "navigation_people",
            "navigation_walls",
            "navigation_time",
            "exploration",
            "lidar_models",
            "scaling",
            "large_map",
        ),
    ),
    "programs": ("Programs", ("cli", "bus", "recording", "dashboard", "page_load")),
}
"""Page, its title and its benchmarks in order."""
HEADLINES: tuple[tuple[str, str], ...] = (
    ("firmware", "flash"),
    ("firmware", "lossless edges/s, line full both ways"),
    ("sim", "simulator: whole robot with lidar, driving a circle"),
    ("tuning", "wheel speed error on 27 robots at 8 rad/s^2, worst: mean / std"),
    ("slam", "scan_match, Intel: path error"),
    ("slam", "scan_match, Intel: CPU per scan, mean / 99 %"),
    ("localization_logs", "localization inside: confirmed right / never / wrong"),
    ("navigation", "the robot's loop in the demo, navigation: share of a core"),
    ("navigation_barn", "BARN x 0.61, dwa + cascade, nominal, 0.5 m/s, seed 0: successes"),
    (
        "navigation_people",
        "people crossing, nominal, 10 scenes at 0.4 m/s: robot drove into a person, arrived",
    ),
    ("page_load", "page, first paint, empty cache"),
)
"""Benchmark and beginning of the row, for the overview."""
PART = re.compile(r" / |, | ± ")
"""Between the parts of a figure, as in `3.1 / 5.1`."""
HEAD = "| what | ours | aim | others | load |\n" + "|---" * 5 + "|\n"


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


def line(figure: dict[str, str]) -> str:
    """Return a row of the table in Markdown. Call it right after the benchmark, for its load."""
    ours = f"{figure['ours']} {figure.get('unit', '')}".strip()
    aim = figure.get("aim", "")
    missed = " **missed**" if misses(figure["ours"], aim) else ""
    aim = aim.replace("<=", "≤").replace(">=", "≥").replace("+-", "±") + missed
    peers, source = figure.get("peers", ""), figure.get("source", "")
    others = f"{peers} ({source})" if source else peers
    return f"| {figure['what']} | {ours} | {aim} | {others} | {os.getloadavg()[0]:.1f} |"


def misses(ours: str, aim: str) -> bool:
    """Return whether a figure misses its aim: `<= 5`, `>= 95 %`, `60 to 110`, `+- 2`, `18 of 20`, or `0`.

    Parts between ` / ` have aims of their own, `-` for none; a single aim holds for all parts.
    """
    parts, aims = PART.split(ours), PART.split(aim)
    if len(aims) == 1:
        aims *= len(parts)
    return any(_misses(part, one) for part, one in zip(parts, aims, strict=False))


def _misses(part: str, aim: str) -> bool:
    counted, value, wanted = re.match(r"(\d+) of (\d+)", part), numbers(part), numbers(aim)
    if not value or not wanted:
        return False
    if counted and "%" in aim:
        value = [100.0 * int(counted[1]) / int(counted[2])]
    if " to " in aim:
        return not wanted[0] <= value[0] <= wanted[1]
    if "+-" in aim:
        return abs(value[0] - (wanted[0] if len(wanted) > 1 else 0.0)) > wanted[-1]
    if aim.startswith("<"):
        return value[0] > wanted[0]
    if aim.startswith(">=") or " of " in aim:
        return value[0] < wanted[0]
    return value[0] <= wanted[0] if aim.startswith(">") else value[0] != wanted[0]


def numbers(text: str) -> list[float]:
    """Return the numbers in a text."""
    return [float(number) for number in re.findall(r"(?<![\w.])[+-]?\d+(?:\.\d+)?", text.replace("+-", " "))]


def machine() -> str:
    """Describe this computer."""
    info = Path("/proc/cpuinfo")
    found = re.search(r"model name\s*: (.*)", info.read_text(encoding="utf-8")) if info.exists() else None
    processor = found[1].strip() if found else platform.machine()
    return f"{processor}, {os.cpu_count()} cores, Python {platform.python_version()}."


def read_rows() -> dict[str, list[str]]:
    """Return the rows of each benchmark from its page."""
    text = "".join(path.read_text(encoding="utf-8") for path in sorted(PAGES.glob("*.md")))
    sections = dict(re.findall(r"(?ms)^## (\w+)\n(.*?)(?=^#|\Z)", text))
    return {name: re.findall(r"(?m)^\| (?!what ).*$", sections.get(name, "")) for name in BENCHMARKS}


def area_page(title: str, names: tuple[str, ...], rows: dict[str, list[str]]) -> str:
    """Return the page of an area: one section per benchmark, with its commands and its rows."""
    text = (
        f"{MARK}\n# {title}: all figures\n\n{machine()} [Overview](../benchmarks.md) explains the columns.\n"
    )
    for name in names:
        commands = [f"python benchmarks/{name}.py {options}".strip() for options in BENCHMARKS[name]]
        text += f"\n## {name}\n\n```sh\n" + "\n".join(commands) + f"\n```\n\n{HEAD}"
        text += "\n".join(rows[name]) + "\n"
    return text


def overview(rows: dict[str, list[str]]) -> str:
    """Return the generated part of the overview: the headlines and the pages."""
    lines = [machine(), "", HEAD.rstrip()]
    pages = {name: area for area, (_, names) in AREAS.items() for name in names}
    for name, what in HEADLINES:
        link = f"[{name}](benchmarks/{pages[name]}.md#{name}): "
        lines += [f"| {link}{row[2:]}" for row in rows[name] if row.startswith(f"| {what} |")][:1]
    lines += ["", "## All figures", "", "| page | benchmarks | rows |", "|---|---|---|"]
    for area, (title, names) in AREAS.items():
        listed = ", ".join(f"[{name}](benchmarks/{area}.md#{name})" for name in names)
        lines.append(
            f"| [{title}](benchmarks/{area}.md) | {listed} | {sum(len(rows[name]) for name in names)} |"
        )
    return "\n".join(lines) + "\n"


def write_pages(rows: dict[str, list[str]]) -> None:
    """Write the pages of all areas and the overview."""
    for area, (title, names) in AREAS.items():
        (PAGES / f"{area}.md").write_text(area_page(title, names, rows), encoding="utf-8")
    text, _, _ = PAGE.read_text(encoding="utf-8").partition(MARK)
    PAGE.write_text(f"{text}{MARK}\n{overview(rows)}", encoding="utf-8")


def main(names: list[str]) -> int:
    """Run the benchmarks, write the pages, and return the exit code."""
    unknown = sorted(set(names) - set(BENCHMARKS))
    if unknown:
        print(f"unknown benchmark {unknown[0]!r}; choose from {', '.join(BENCHMARKS)}", file=sys.stderr)
        return 2
    rows = read_rows()
    all_well = True
    for name in names or BENCHMARKS:
        rows[name] = []
        for options in BENCHMARKS[name]:
            figures, well = run(name, options)
            all_well &= well
            rows[name] += [line(figure) for figure in figures]
    write_pages(rows)
    print(f"wrote {PAGE.relative_to(HERE.parent)} and its pages")
    return 0 if all_well else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
