"""Every reader of a file that a user may pass, each with small valid files."""

import json
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from benchmarks.shared.recorded_run import RUN, cycles
from benchmarks.shared.rooms import room_scan
from scipy.io import savemat

from tests.hil.campaign.samples import FILE as CAMPAIGN
from tests.hil.campaign.samples import row
from thumper.cli.plan_queries import read_queries
from thumper.common.geometry import Pose2, Twist2
from thumper.config.robot import load_config
from thumper.dashboard.playback import part_of
from thumper.maps.annotations import (
    Annotations,
    SavedPlace,
    Zone,
    ZoneKind,
    load_annotations,
    save_annotations,
)
from thumper.maps.map_server_io import load_datum, load_map, load_rotated_map, save_map
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.filters import load_mask
from thumper.offline.open_log import open_log
from thumper.recording.reader import Recording
from thumper.recording.recorder import Recorder
from thumper.recording.repair import repair
from thumper.slam.factory import MappingOptions, make_mapper
from thumper.slam.saved_state import SavedSlamState, load_session, save_session
from thumper_hil.campaign.result_table import RowStore
from thumper_hil.campaign.spec import expand_jobs, load_campaign
from thumper_hil.chip.hex_file import read_hex
from thumper_hil.chip.robot_params import WILD_THUMPER, RobotParams
from thumper_hil.faults.scenario import load_scenario
from thumper_hil.world.scene import Scene
from thumper_hil.world.world import World
from thumper_hil.world.world_file import WORLDS
from thumper_tuning.calibration.wheel_log import COUNT_COLUMNS, read_csv
from thumper_tuning.cli.gains_file import read_gains_file
from thumper_tuning.logs.read import read_logs

GRID = OccupancyGrid(
    cells=np.array([[0, 100, -1], [0, 0, 100]], np.int8), resolution_m=0.5, origin_x_m=-1.0, origin_y_m=0.0
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reader:
    """A reader, the name of its file, and valid contents to start from."""

    name: str
    file: str
    read: Callable[[Path], object]
    contents: Callable[[], list[bytes]]
    beside: Callable[[Path], object] = lambda _folder: None  # writes files that the file refers to


def read_robot(path: Path) -> object:
    return load_config(path)


def read_world(path: Path) -> object:
    return Scene(World.load(path))


def read_campaign(path: Path) -> object:
    return expand_jobs(load_campaign(path), path.parent)


def read_recording(path: Path) -> object:
    recording = Recording((path,))
    recording.run_metadata()
    for message in recording.messages():
        try:
            message.decode()
        except (KeyError, ValueError):
            continue
    return recording


def read_map(path: Path) -> object:
    return load_rotated_map(path), load_datum(path)


def read_part(path: Path) -> object:
    return list(part_of(path, 0.5, 10.0))


def read_to_repair(path: Path) -> object:
    with TemporaryDirectory() as folder:
        link = Path(folder) / path.name  # the repaired file appears beside it
        link.symlink_to(path)
        return repair(link)


def read_rows(path: Path) -> object:
    with RowStore(path.parent, "digest") as store:
        return store.rows


@cache
def written(write: Callable[[Path], Any], name: str) -> bytes:
    """Return what `write` writes into a file of this name."""
    with TemporaryDirectory() as folder:
        write(Path(folder))
        (path,) = Path(folder).rglob(name)
        return path.read_bytes()


def write_recording(folder: Path, count: int = 12) -> None:
    recorder = Recorder(folder, RUN)
    for topic, now_s, message in cycles(count):
        recorder(topic, now_s, message)
    recorder.close()


def write_drive(folder: Path) -> None:
    write_recording(folder, 40)


def write_session(folder: Path) -> None:
    mapper = make_mapper(MappingOptions())
    mapper.update(Pose2(), room_scan(Pose2()), Twist2())
    save_session(SavedSlamState(counts=mapper.counts(), map_from_base=Pose2(x_m=0.4)), folder / "map.session")


def write_rows(folder: Path) -> None:
    with RowStore(folder, "digest") as store:
        store.add(row("a"))
        store.add(row("b", reason="blocked"))


def write_grid(folder: Path) -> object:
    return save_map(GRID, folder / "map.yaml")


def write_annotations(folder: Path) -> object:
    zones = [
        Zone(name="stairs", kind=kind, vertices_m=((0.0, 0.0), (1.5, 0.0), (1.5, 2.0)), speed_percent=40)
        for kind in ZoneKind
    ]
    annotations = Annotations(places=(SavedPlace(name="dock", x_m=1.0, y_m=-2.5, yaw_rad=0.5),))
    for number, zone in enumerate(zones):
        annotations = annotations.with_item(replace(zone, name=f"{zone.name} {number}"))
    return save_annotations(annotations, folder / "map.geojson")


def write_matlab(folder: Path) -> None:
    time_s = 0.1 * np.arange(40)
    columns = {"time_s": time_s, "pwm": 100.0 * (np.arange(40) % 2), "counts": 7.0 * np.arange(40)}
    savemat(folder / "a.mat", columns, do_compression=True)


def copy_worlds(folder: Path) -> None:
    for path in WORLDS.glob("*.toml"):
        shutil.copy(path, folder)


def texts(*contents: str) -> Callable[[], list[bytes]]:
    return lambda: [content.encode() for content in contents]


def tomls(folder: Path) -> Callable[[], list[bytes]]:
    return lambda: [path.read_bytes() for path in sorted(folder.glob("*.toml"))]


ROBOT = """
name = "mole"
[board]
port = "/dev/ttyUSB0"
baud = 500000
[navigation]
planner = "astar"
[navigation.limits]
v_max_m_s = 0.3
[navigation.masks]
keepout = "mask.yaml"
[mapping]
resolution_m = 0.05
[bus]
address = "127.0.0.1:7448"
"""
SCENARIO = 'faults = [{ at_s = 3.0, encoder.left.b = "cut" }, { at_s = 5.0, line.noise = 0.01 }]\n'
FLASER = "PARAM laser_front_laser_resolution 1.0\n" + "".join(
    f"FLASER 4 1.0 81.83 2.5 0.0 {k} 2.0 0.5 {k} 2.0 0.5 9760528{k}.5 nohost {k}.0\n" for k in range(12)
)
MINES = "".join(
    f"{100_000 * k} 14710 {10 * k} {10 * k} 0 0 0 170.1 {'1 ' * 16}{'1000 ' * 682}0\n" for k in range(3)
)
MOTOR = "time_s,pwm,counts\n" + "".join(f"{0.1 * k:.1f},{100 * (k % 2)},{7 * k}\n" for k in range(40))
SYSID = json.dumps(
    {
        "units": "Meters",
        "unitsPerRotation": 0.4,
        "slow-forward": [[0.02 * k, 1.0, 1.0, 0.1 * k, 0.1 * k, 0.5, 0.5, 0, 0] for k in range(30)],
    }
)
GAINS = json.dumps({"gains": {"kp": 8.0, "ki": 2.0, "ks": 10.0, "kv": 12.0, "ka": 1.0, "acceleration": 9.0}})
COUNTS = "time_s,left_counts,right_counts\n" + "".join(f"{0.1 * k:.1f},{k},{k}\n" for k in range(9))
HEX = ":0300300002337A1E\n:00000001FF\n"
YAML = """image: map.pgm
resolution: 0.5
origin: [-1.0, 0.0, 0.3]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def readers() -> Iterator[Reader]:
    """Yield all readers."""
    yield Reader(name="robot", file="robot.toml", read=read_robot, contents=texts(ROBOT))
    yield Reader(name="world", file="world.toml", read=read_world, contents=tomls(WORLDS), beside=copy_worlds)
    yield Reader(name="scenario", file="faults.toml", read=load_scenario, contents=texts(SCENARIO))
    yield Reader(
        name="campaign",
        file="campaign.toml",
        read=read_campaign,
        contents=texts(CAMPAIGN.replace(', { name = "gentle", robot = "gentle.toml" }', "")),
    )
    yield Reader(
        name="robot_params",
        file="params.toml",
        read=RobotParams.load,
        contents=lambda: [WILD_THUMPER.read_bytes()],
    )
    yield Reader(name="map", file="map.yaml", read=read_map, contents=texts(YAML), beside=write_grid)
    yield Reader(
        name="mask",
        file="map.yaml",
        read=load_mask,
        contents=texts(YAML.replace("0.3]", "0.0]") + "mode: scale\n"),
        beside=write_grid,
    )
    yield Reader(
        name="map_image",
        file="map.pgm",
        read=lambda path: load_map(path.with_suffix(".yaml")),
        contents=lambda: [written(write_grid, "map.pgm"), b"P2 3 2 255 0 0 0 0 254 205\n"],
        beside=write_grid,
    )
    yield Reader(
        name="session",
        file="map.session",
        read=lambda path: load_session(path, 0.05),
        contents=lambda: [written(write_session, "map.session")],
    )
    yield Reader(name="carmen", file="a.log", read=open_log, contents=texts(FLASER))
    yield Reader(name="mines", file="a.dat", read=open_log, contents=texts(MINES))
    yield Reader(
        name="mcap_log", file="a.mcap", read=open_log, contents=lambda: [written(write_recording, "*.mcap")]
    )
    yield Reader(
        name="recording",
        file="a.mcap",
        read=read_recording,
        contents=lambda: [written(write_recording, "*.mcap")],
    )
    yield Reader(
        name="playback", file="a.mcap", read=read_part, contents=lambda: [written(write_recording, "*.mcap")]
    )
    yield Reader(
        name="repair",
        file="a.mcap",
        read=read_to_repair,
        contents=lambda: [written(write_recording, "*.mcap")],
    )
    yield Reader(
        name="annotations",
        file="map.geojson",
        read=load_annotations,
        contents=lambda: [written(write_annotations, "map.geojson")],
    )
    yield Reader(name="motor_log", file="a.csv", read=read_logs, contents=texts(MOTOR))
    yield Reader(
        name="matlab", file="a.mat", read=read_logs, contents=lambda: [written(write_matlab, "a.mat")]
    )
    yield Reader(
        name="motor_mcap",
        file="a.mcap",
        read=read_logs,
        contents=lambda: [written(write_drive, "*.mcap")],
    )
    yield Reader(name="sysid", file="a.json", read=read_logs, contents=texts(SYSID))
    yield Reader(name="gains", file="gains.json", read=read_gains_file, contents=texts(GAINS))
    yield Reader(
        name="wheel_log",
        file="counts.csv",
        read=lambda path: read_csv(path, COUNT_COLUMNS),
        contents=texts(COUNTS),
    )
    yield Reader(
        name="queries",
        file="queries.csv",
        read=lambda path: read_queries(path, GRID),
        contents=texts(
            "start_x,start_y,goal_x,goal_y\n0,0,1,1\n", "start_col,start_row,goal_col,goal_row\n0,0,2,1\n"
        ),
    )
    yield Reader(
        name="rows", file="rows.csv", read=read_rows, contents=lambda: [written(write_rows, "rows.csv")]
    )
    yield Reader(name="hex", file="a.hex", read=read_hex, contents=texts(HEX))
