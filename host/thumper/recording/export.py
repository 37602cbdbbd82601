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
from thumper.recording.mcap_file import PART
from thumper.recording.reader import Recording
from thumper.ros import from_ros
from thumper.ros.codec import Message
from thumper.ros.topics import TOPICS

MAX_ARRAY_COLUMNS = 2048  # enough for a scan, not for a map
Row = dict[str, Any]


def export_csv(recording: Recording, folder: Path) -> list[Path]:
    """Write one CSV table per topic; return the files. Columns are named after the message's fields.

    A message is one row; each element of a path, of particles and of transforms is one row with its index.
    Scans may differ in length: the table has the columns of the longest. Quaternions become `yaw`. Stamps and
    `log_time_s` are seconds since 1970, or since the start of a simulation. Maps are exported without their
    cells. Existing tables are replaced once all new ones are complete.

    Raises
    ------
    ThumperError
        The folder is not writable, or its disk is full.
    """
    columns: dict[str, Row] = {}
    for topic, row in _table_rows(recording):
        columns[topic] = _merged(columns.get(topic, {}), row)
    recording.notes.clear()  # the second pass makes them again
    parts = {topic: folder / f"{topic.replace('/', '_')}.csv{PART}" for topic in columns}
    try:
        with ExitStack() as stack:
            writers = {}
            for topic, part in parts.items():
                file = stack.enter_context(part.open("w", newline="", encoding="utf-8"))
                writers[topic] = csv.DictWriter(file, columns[topic], restval="", lineterminator="\n")
                writers[topic].writeheader()
            for topic, row in _table_rows(recording):
                writers[topic].writerow(row)
        return sorted(part.rename(part.with_suffix("")) for part in parts.values())
    except OSError as error:
        for part in parts.values():
            part.unlink(missing_ok=True)
        raise ThumperError(
            f"{folder}: cannot write ({error.strerror}); choose another folder", exit_code=EXIT_USAGE
        ) from error


def _table_rows(recording: Recording) -> Iterator[tuple[str, Row]]:
    """Yield topic and row of everything that can be decoded."""
    for recorded in recording.messages():
        try:
            rows = list(_rows(recorded.decode()))
        except (ValueError, KeyError):
            continue
        for row in rows:
            yield recorded.topic, {"log_time_s": seconds(recorded.log_ns), **row}


def _merged(columns: Row, row: Row) -> Row:
    """Return the columns, as keys, with those of the row that are new behind the one that precedes them."""
    if row.keys() <= columns.keys():
        return columns
    merged, position = list(columns), 0
    for name in row:
        if name in columns:
            position = merged.index(name) + 1
        else:
            merged.insert(position, name)
            position += 1
    return dict.fromkeys(merged)


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
        into[f"{name}.yaw"] = from_ros.roll_pitch_yaw_of(value)[2]
    elif is_dataclass(value):
        for field in _fields(value):
            _flatten(f"{name}.{field.name}" if name else field.name, getattr(value, field.name), into)
    elif isinstance(value, np.ndarray):
        if value.size <= MAX_ARRAY_COLUMNS:
            into.update({f"{name}.{index}": number for index, number in enumerate(value.tolist())})
    else:
        into[name] = value


def _fields(message: Message) -> list[Field[Any]]:
    """Return the fields of the message, without the one that holds its type's name."""
    return [field for field in fields(message) if field.name != "__msgtype__"]
