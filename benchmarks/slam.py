"""SLAM on recorded logs: CPU time per scan and error of relative poses, next to other programs.

Run: python benchmarks/slam.py [--data FOLDER] [--method slam|scan_match|rbpf] [--seeds N] [--beam-std M]
                                [--vary]

The logs are in the folder's subfolder `slam`; the default folder is THUMPER_DATA or ../shared/data.
"""

import argparse
import os
import resource
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from thumper.common.geometry import FloatArray
from thumper.offline.metrics import RelationErrors, load_relations, relation_errors, squareness
from thumper.offline.open_log import open_log
from thumper.offline.robot_log import RobotLog
from thumper.slam.factory import MappingOptions, Method, make_mapper
from thumper.slam.scan_matching.gauss_newton import MatchOptions

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure, require_data

# Others on the same log and relations: path error and online error, the pose that was reported at the time. A
# path that was improved later uses more data than that. `make bench-peers` compares the CPU times.
INTEL_PEERS = (
    ("gmapping, 30 particles", "0.027 ± 0.020", "0.96 ± 0.92", "0.097"),
    ("LaMa particle filter, 30, gate 0.2", "0.020 ± 0.013", "0.51 ± 0.65", "0.058"),
    ("LaMa single hypothesis, gate 0.1", "0.020 ± 0.016", "0.42 ± 0.47", "0.036"),
    ("open_karto, gate 0.2", "0.023 ± 0.024", "0.51 ± 0.63", "0.17"),
    ("BreezySLAM", "2.35 ± 3.71", "14.0 ± 21.0", "2.35"),
)

# integrate_distance_m, integrate_angle_rad and matching.beam_std_m: the defaults, and sets near them.
VARIED = (
    (0.1, 0.1, 0.05),
    (0.09, 0.1, 0.05),
    (0.11, 0.1, 0.05),
    (0.12, 0.1, 0.05),
    (0.1, 0.1, 0.045),
    (0.1, 0.1, 0.055),
    (0.1, 0.12, 0.05),
    (0.1, 0.08, 0.05),
)
LEFT_OUT = (5, 17, 40, 90, 150, 260, 333, 410)  # scans at the start of the log


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One pass over a log."""

    poses: np.ndarray[tuple[int, int], np.dtype[np.float64]]  # final poses
    online: np.ndarray[tuple[int, int], np.dtype[np.float64]]  # as reported at the time
    cpu_ms: np.ndarray[tuple[int], np.dtype[np.float64]]
    inserted: np.ndarray[tuple[int], np.dtype[np.bool_]]


def run(log: RobotLog, options: MappingOptions) -> Run:
    """Map the log as on the robot and time each scan."""
    mapper = make_mapper(options, base_from_laser=log.base_from_laser)
    mapper.warm_up()
    online, cpu_ms, inserted = [], [], []
    for record in log.records:
        start_s = time.process_time()
        update = mapper.update(record.odom_from_base, record.scan, record.twist)
        cpu_ms.append(1e3 * (time.process_time() - start_s))
        inserted.append(update.integrated)
        pose = update.map_from_base
        online.append((pose.x_m, pose.y_m, pose.theta_rad))
    return Run(
        poses=mapper.path(), online=np.array(online), cpu_ms=np.array(cpu_ms), inserted=np.array(inserted)
    )


def seeded(method: Method, seed: int, matching: MatchOptions) -> MappingOptions:
    """Return the default options with this seed of the particle filter."""
    options = MappingOptions(method=method, matching=matching)
    return replace(options, filter=replace(options.filter, seed=seed))


def vary(log: RobotLog, relations: FloatArray, method: Method, console: Console) -> None:
    """Print how far the path error of Intel depends on chance: options near the defaults, later starts."""
    errors_m = []
    for distance_m, angle_rad, beam_std_m in VARIED:
        options = MappingOptions(
            method=method,
            integrate_distance_m=distance_m,
            integrate_angle_rad=angle_rad,
            matching=MatchOptions(beam_std_m=beam_std_m),
        )
        errors_m.append(float(relation_errors(run(log, options).poses, relations).translation_m.mean()))
    _print_spread("options near the defaults", errors_m, console)
    late, errors_m = relations[relations[:, :2].min(axis=1) >= max(LEFT_OUT)], []
    for count in LEFT_OUT:
        result = run(replace(log, records=log.records[count:]), MappingOptions(method=method))
        shifted = late - np.array([count, count, 0.0, 0.0, 0.0])
        errors_m.append(float(relation_errors(result.poses, shifted).translation_m.mean()))
    _print_spread(f"without the first {LEFT_OUT[0]} to {LEFT_OUT[-1]} scans", errors_m, console)


def _print_spread(what: str, errors_m: list[float], console: Console) -> None:
    each = " ".join(f"{error_m:.4f}" for error_m in errors_m)
    mean_m, std_m = np.mean(errors_m), np.std(errors_m, ddof=1)
    console.print(f"Intel, {what}: path {mean_m:.4f} ± {std_m:.4f} m; {each}", soft_wrap=True)


def timing(name: str, result: Run) -> str:
    """Return one line with the CPU times."""
    quantiles, inserted = np.percentile(result.cpu_ms, [50, 99]), result.cpu_ms[result.inserted]
    return (
        f"{name}: {len(result.cpu_ms)} scans, all matched, {len(inserted)} inserted; CPU ms per scan: "
        f"mean {result.cpu_ms.mean():.2f}, median {quantiles[0]:.2f}, 99 % {quantiles[1]:.2f}, "
        f"worst {result.cpu_ms.max():.1f}; inserted scans: mean {inserted.mean():.2f}"
    )


def accuracy(name: str, errors: RelationErrors, online: RelationErrors) -> str:
    """Return one line with the errors."""
    turn_deg = np.degrees(errors.rotation_rad.mean())
    return (
        f"{name}: path {errors.translation_m.mean():.4f} m, {turn_deg:.3f} deg, "
        f"worst relation {errors.translation_m.max():.2f} m, online {online.translation_m.mean():.4f} m"
    )


def intel_table(errors: RelationErrors, online: RelationErrors, result: Run, method: Method) -> Table:
    """Return the table of all programs on the Intel log."""
    table = Table(title="Intel Research Lab, 7129 scans, relations by scan")
    for column in ("program", "path [m]", "path [deg]", "online [m]", "CPU [ms/scan]"):
        table.add_column(column)
    degrees = np.degrees(errors.rotation_rad)
    metres = errors.translation_m
    table.add_row(
        f"thumper {method}",
        f"{metres.mean():.4f} ± {metres.std():.4f}",
        f"{degrees.mean():.3f} ± {degrees.std():.3f}",
        f"{online.translation_m.mean():.4f}",
        f"{result.cpu_ms.mean():.2f}",
    )
    for row in INTEL_PEERS:
        table.add_row(*row)
    return table


def report(
    method: Method, mines: Run, intel: Run, errors: RelationErrors, online: RelationErrors, peak_MB: float
) -> None:
    """Record the figures for the table of all benchmarks."""
    for name, run_ in {"MINES": mines, "Intel": intel}.items():
        cost = f"{run_.cpu_ms.mean():.2f} / {np.percentile(run_.cpu_ms, 99):.1f}"
        figure(f"{method}, {name}: CPU per scan, mean / 99 %", cost, "ms")
    rows = (
        ("path error", f"{errors.translation_m.mean():.4f}", "m", "<= 0.022", 1),
        ("path error", f"{np.degrees(errors.rotation_rad.mean()):.2f}", "deg", "<= 0.6", 2),
        ("online error", f"{online.translation_m.mean():.3f}", "m", "<= 0.05", 3),
    )
    for what, ours, unit, aim, column in rows:
        others = "; ".join(f"{row[0]}: {row[column].split(' ')[0]}" for row in INTEL_PEERS)
        figure(f"{method}, Intel: {what}", ours, unit, aim=aim, peers=others, source="same log")
    figure(f"{method}: peak memory, both logs loaded", f"{peak_MB:.0f}", "MB", aim="<= 250")


def main() -> None:
    """Print both tables."""
    default = Path(os.environ.get("THUMPER_DATA", Path(__file__).parents[2] / "shared" / "data"))
    parser = argparse.ArgumentParser(description="SLAM benchmark on recorded logs")
    parser.add_argument("--data", type=Path, default=default, help="folder that contains slam/")
    parser.add_argument("--method", choices=("slam", "scan_match", "rbpf"), default="slam")
    parser.add_argument("--seeds", type=int, default=1, help="run the particle filter with seeds 1 to N")
    parser.add_argument("--vary", action="store_true", help="only the spread of the path error on Intel")
    parser.add_argument(
        "--beam-std", type=float, default=MatchOptions().beam_std_m, help="beam_std_m of the scan match, m"
    )
    arguments = parser.parse_args()
    folder, method = arguments.data / "slam", arguments.method
    matching = MatchOptions(beam_std_m=arguments.beam_std)
    console = Console()
    require_data(folder / "intel-lab.clf.gz")
    intel = open_log(folder / "intel-lab.clf.gz")
    relations = load_relations(folder / "intel-lab.relations-by-scan.gz")
    if arguments.vary:
        vary(intel, relations, method, console)
        return

    mines = open_log(folder / "mines-exp1.dat.gz")
    seeds = range(arguments.seeds, 0, -1)  # the tables show seed 1
    for seed in seeds:
        result = first = run(mines, seeded(method, seed, matching))
        console.print(timing(f"MINES, seed {seed}", result), soft_wrap=True)
        console.print(f"MINES, seed {seed}: squareness {squareness(mines, result.poses):.3f}")
    means = []  # path [m], path [deg], online [m]
    for seed in seeds:
        result = run(intel, seeded(method, seed, matching))
        errors, online = relation_errors(result.poses, relations), relation_errors(result.online, relations)
        console.print(timing(f"Intel, seed {seed}", result), soft_wrap=True)
        console.print(accuracy(f"Intel, seed {seed}", errors, online), soft_wrap=True)
        turn_deg = np.degrees(errors.rotation_rad.mean())
        means.append((errors.translation_m.mean(), turn_deg, online.translation_m.mean()))
    mean, worst = np.mean(means, axis=0), np.max(means, axis=0)
    console.print(
        f"Intel, {len(means)} seeds, mean and worst: path {mean[0]:.4f} {worst[0]:.4f} m, "
        f"{mean[1]:.3f} {worst[1]:.3f} deg, online {mean[2]:.4f} {worst[2]:.4f} m",
        soft_wrap=True,
    )
    console.print(intel_table(errors, online, result, method))
    peak_MB = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    console.print(f"Peak memory with both logs loaded: {peak_MB:.0f} MB")
    report(method, first, result, errors, online, peak_MB)


if __name__ == "__main__":
    main()
