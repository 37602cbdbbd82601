"""Imports go one way: each package imports only from packages in a lower row."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
HOST = ROOT / "host" / "thumper"
FOLDERS = {
    "thumper": HOST,
    "thumper_hil": ROOT / "hil" / "thumper_hil",
    "thumper_tuning": ROOT / "tuning" / "thumper_tuning",
}

LAYERS = (
    "common",
    "camera gps imu",
    "board lidar odometry maps",
    "slam navigation",
    "ros config",
    "runtime teleop",
    "bus robot doctor",
    "recording ros2 __init__",
    "dashboard offline foxglove",
    "cli",
    "__main__",
)
NAVIGATION = (
    "footprint goal speed_limits state",
    "costmap",
    "planners",
    "controllers",
    "recovery safety",
    "options",
    "registry",
    "parts",
    "navigator",
    "warm_up",
)
SLAM = (
    "mapper pose_arrays",
    "scan_matching saved_state",
    "grid",
    "localization particle_filter pose_graph",
    "edited_map factory mounting",
    "mode_switch",
)
RUNTIME = (
    "drive_log drive_result object_place real_time_rate requests tag_anchors",
    "object_map state_estimator",
    "sensor_table",
    "sensor_inputs",
    "safe_stop",
    "drive",
    "publisher",
    "service",
    "object_finder reconnection",
    "control_cycle",
    "loop",
    "assembly",
)
TUNING = (
    "logs",
    "identify",
    "design",
    "drive",
    "calibration report warm_up",
    "cli",
)
IDENTIFY = (
    "model",
    "motor_response covariance",
    "segments systems",
    "prediction realization saturation",
    "least_squares",
    "initial_guess sensor_window",
    "fit",
    "cross_validation exponential_filter",
    "stretches",
    "excitation_checks fit_warnings richer_models",
    "compare_models",
    "motor",
    "motor_constants partial_motor",
    "static_part",
    "partial",
    "result_json",
)

HIL = (
    "effects",
    "chip world",
    "lidars faults",
    "sensors",
    "bench",
    "kinematic courses demo campaign",
    "cli",
)

INSIDE = {"navigation": NAVIGATION, "slam": SLAM, "runtime": RUNTIME}


def imports(path: Path) -> set[str]:
    """All modules that the file imports, also those inside functions."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


@pytest.mark.parametrize(
    ("package", "layers"),
    [
        ("thumper", LAYERS),
        *((f"thumper.{name}", rows) for name, rows in INSIDE.items()),
        ("thumper_hil", HIL),
        ("thumper_tuning", TUNING),
        ("thumper_tuning.identify", IDENTIFY),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_imports_go_down(package: str, layers: tuple[str, ...]) -> None:
    floor = {name: number for number, row in enumerate(layers) for name in row.split()}
    root, *inner = package.split(".")
    folder = FOLDERS[root].joinpath(*inner)
    for path in sorted(folder.rglob("*.py")):
        own = path.relative_to(folder).parts[0].removesuffix(".py")
        if own == "__init__" and "__init__" not in floor:
            continue
        for name in imports(path):
            if name.startswith(f"{package}."):
                other = name.removeprefix(f"{package}.").split(".")[0]
                other = other if other in floor else "__init__"
                assert other == own or floor[other] < floor[own], f"{path.relative_to(ROOT)} imports {name}"


def test_the_robot_does_not_import_the_simulator() -> None:
    for path in sorted(HOST.rglob("*.py")):
        outside = {name for name in imports(path) if name.startswith(("thumper_hil", "thumper_tuning"))}
        assert not outside, path


@pytest.mark.parametrize("package", ["slam", "navigation", "maps", "odometry"])
def test_the_algorithms_read_no_clock_and_open_no_port(package: str) -> None:
    shell = {"asyncio", "multiprocessing", "serial", "socket", "subprocess", "threading", "time"}
    for path in sorted((HOST / package).rglob("*.py")):
        assert not {name.split(".")[0] for name in imports(path)} & shell, path
