"""Export a recording as CSV tables, and read its last map."""

import csv
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import Field, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import FloatArray
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.recording.reader import Recording
from thumper.ros import from_ros
from thumper.ros.codec import Message
from thumper.ros.topics import TOPICS

MAX_ARRAY_COLUMNS = 2048  # enough for a scan, not for a map
Row = dict[str, Any]


def export_csv(recording: Recording, folder: Path) -> list[Path]:
    """Write one CSV table per topic; return the files. Columns are named after the message's fields.

    A message is one row; each element of a path, of particles and of transforms is one row with its index.
    Quaternions become `yaw`. Stamps and `log_time_s` are seconds since 1970, or since the start of a
    simulation. Maps are exported without their cells.

    Raises
    ------
    ThumperError
        The folder is not writable.
    """
    writers: dict[str, tuple[Any, list[str], Path]] = {}
    try:
        with ExitStack() as stack:
            for recorded in recording.messages():
                try:
                    rows = list(_rows(recorded.decode()))
                except (ValueError, KeyError):
                    continue
                for row in rows:
                    if recorded.topic not in writers:
                        path = folder / f"{recorded.topic.replace('/', '_')}.csv"
                        columns = ["log_time_s", *row]
                        writer = csv.writer(
                            stack.enter_context(path.open("w", newline="", encoding="utf-8")),
                            lineterminator="\n",
                        )
                        writer.writerow(columns)
                        writers[recorded.topic] = (writer, columns, path)
                    writer, columns, _ = writers[recorded.topic]
                    row["log_time_s"] = seconds(recorded.log_ns)
                    writer.writerow([row.get(column, "") for column in columns])
    except OSError as error:
        raise ThumperError(
            f"{folder}: cannot write ({error.strerror}); choose another folder", exit_code=EXIT_USAGE
        ) from error
    return sorted(path for _, _, path in writers.values())


def last_map(recording: Recording) -> tuple[OccupancyGrid, FloatArray]:
    """Return the newest map, and the driven path in it: x, y [m], shape (n, 2).

    Messages of other types on these topics, and messages that cannot be decoded, are skipped.

    Raises
    ------
    ThumperError
        The recording has no map.
    """
    grid: OccupancyGrid | None = None
    poses: list[tuple[float, float]] = []
    for recorded in recording.messages():
        if recorded.topic not in ("map", "pose") or recorded.type_name != TOPICS[recorded.topic].type_name:
            continue
        with suppress(ValueError):
            if recorded.topic == "map":
                grid = from_ros.grid_of(recorded.decode())
            else:
                pose = from_ros.pose_of(recorded.decode().pose.pose)
                poses.append((pose.x_m, pose.y_m))
    if grid is None:
        raise ThumperError(
            f"{recording.name}: it has no map; `thumper replay` makes one from the scans",
            exit_code=EXIT_USAGE,
        )
    return grid, np.array(poses, dtype=np.float64).reshape(-1, 2)


def seconds(ns: int) -> str:
    """Format a stamp [ns] as decimal seconds, exact to the nanosecond."""
    return f"{ns // 1_000_000_000}.{ns % 1_000_000_000:09d}"


def _rows(message: Message) -> Iterator[Row]:
    """Yield the flattened message as one row, or as one row per element of its list."""
    shared: Row = {}
    elements: list[Any] | None = None
    for field in _fields(message):
        value = getattr(message, field.name)
        if isinstance(value, list):
            elements = value
        else:
            _flatten(field.name, value, shared)
    if elements is None:
        yield shared
        return
    for index, element in enumerate(elements):
        row: Row = {**shared, "index": index}
        _flatten("", element, row)
        yield row


def _flatten(name: str, value: Any, into: Row) -> None:
    kind = getattr(value, "__msgtype__", "")
    if kind == "builtin_interfaces/msg/Time":
        into[name] = seconds(value.sec * 1_000_000_000 + value.nanosec)
    elif kind == "geometry_msgs/msg/Quaternion":
        into[f"{name}.yaw"] = _yaw_rad(value)
    elif is_dataclass(value):
        for field in _fields(value):
            _flatten(f"{name}.{field.name}" if name else field.name, getattr(value, field.name), into)
    elif isinstance(value, np.ndarray):
        if value.size <= MAX_ARRAY_COLUMNS:
            into.update({f"{name}.{index}": number for index, number in enumerate(value.tolist())})
    else:
        into[name] = value


def _yaw_rad(q: Any) -> float:
    return float(np.arctan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y**2 + q.z**2)))


def _fields(message: Message) -> list[Field[Any]]:
    """Return the fields of the message, without the one that holds its type's name."""
    return [field for field in fields(message) if field.name != "__msgtype__"]
