"""A recording as tables for spreadsheets, as a map file, as a picture."""

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

LARGEST_ARRAY = 2048  # numbers that a row may hold: a scan, not a map
Row = dict[str, Any]


def export_csv(recording: Recording, folder: Path) -> list[Path]:
    """Write one table a topic; returns the files. Columns are named as the message's fields.

    A message is a row; of a path, a cloud of particles or a set of transforms each element is one, with its
    index. Quaternions become `yaw`; stamps and `log_time_s` are seconds since 1970, or since the start of a
    simulation. Of a map the row says where it lies; its cells are left out: they are no table.

    Raises
    ------
    ThumperError
        The folder cannot be written.
    """
    writers: dict[str, tuple[Any, list[str], Path]] = {}
    try:
        with ExitStack() as stack:
            for said in recording.said():
                try:
                    rows = list(_rows(said.message()))
                except (ValueError, KeyError):
                    continue
                for row in rows:
                    if said.topic not in writers:
                        path = folder / f"{said.topic.replace('/', '_')}.csv"
                        columns = ["log_time_s", *row]
                        writer = csv.writer(
                            stack.enter_context(path.open("w", newline="", encoding="utf-8")),
                            lineterminator="\n",
                        )
                        writer.writerow(columns)
                        writers[said.topic] = (writer, columns, path)
                    writer, columns, _ = writers[said.topic]
                    row["log_time_s"] = seconds(said.log_ns)
                    writer.writerow([row.get(column, "") for column in columns])
    except OSError as error:
        raise ThumperError(
            f"{folder}: cannot be written ({error.strerror}); choose another", exit_code=EXIT_USAGE
        ) from error
    return sorted(path for _, _, path in writers.values())


def last_map(recording: Recording) -> tuple[OccupancyGrid, FloatArray]:
    """The newest map that was published, and the path driven: x, y in it [m], shape (n, 2).

    What other programs say under our topics' names in other types, or as we cannot take it, is left out.

    Raises
    ------
    ThumperError
        There is no map in the recording.
    """
    grid: OccupancyGrid | None = None
    poses: list[tuple[float, float]] = []
    for said in recording.said():
        if said.topic not in ("map", "pose") or said.type_name != TOPICS[said.topic].type_name:
            continue
        with suppress(ValueError):
            if said.topic == "map":
                grid = from_ros.grid_of(said.message())
            else:
                pose = from_ros.pose_of(said.message().pose.pose)
                poses.append((pose.x_m, pose.y_m))
    if grid is None:
        raise ThumperError(
            f"{recording.name}: no map in it; `thumper replay` makes one from the scans", exit_code=EXIT_USAGE
        )
    return grid, np.array(poses, dtype=np.float64).reshape(-1, 2)


def seconds(ns: int) -> str:
    """A stamp as a decimal number, to the nanosecond."""
    return f"{ns // 1_000_000_000}.{ns % 1_000_000_000:09d}"


def _rows(message: Message) -> Iterator[Row]:
    """The message flattened; its list of messages, if it has one, becomes rows."""
    shared: Row = {}
    many: list[Any] | None = None
    for field in _fields(message):
        value = getattr(message, field.name)
        if isinstance(value, list):
            many = value
        else:
            _flatten(field.name, value, shared)
    if many is None:
        yield shared
        return
    for index, element in enumerate(many):
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
        if value.size <= LARGEST_ARRAY:
            into.update({f"{name}.{index}": number for index, number in enumerate(value.tolist())})
    else:
        into[name] = value


def _yaw_rad(q: Any) -> float:
    return float(np.arctan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y**2 + q.z**2)))


def _fields(message: Message) -> list[Field[Any]]:
    """What the message holds; its type's name is kept as one more field."""
    return [field for field in fields(message) if field.name != "__msgtype__"]
