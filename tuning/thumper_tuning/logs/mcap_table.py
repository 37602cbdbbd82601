"""Read MCAP recordings: the wheels topic of Thumper, or JointState and a command of another ROS 2 robot."""

from pathlib import Path
from typing import Any

import numpy as np

from thumper.common.errors import EXIT_CHECK_FAILED, ThumperError
from thumper.common.geometry import FloatArray
from thumper_tuning.logs.table import LogTable

WHEELS, JOINTS = "thumper_msgs/msg/Wheels", "sensor_msgs/msg/JointState"
COMMANDS = ("std_msgs/msg/Float64MultiArray", "std_msgs/msg/Float64", "std_msgs/msg/Float32")
WHEEL_HEADERS = ("time_s", "left_pwm", "left_counts", "right_pwm", "right_counts")


def read_mcap_table(path: Path) -> LogTable:
    """Return the wheels of a Thumper recording, or the joints of another robot.

    The drive of a joint is its command (Float64, or its place in a Float64MultiArray), else its effort.

    Raises
    ------
    ThumperError
        The file is not MCAP, or has no such messages.
    """
    from thumper.recording.reader import Recording  # loads the ROS 2 types

    messages: dict[str, list[tuple[int, Any]]] = {}
    for recorded in Recording((path,)).messages():
        if recorded.type_name in (WHEELS, JOINTS, *COMMANDS):
            try:
                message = recorded.decode()
            except (ValueError, KeyError):
                continue  # a damaged message
            messages.setdefault(recorded.type_name, []).append((recorded.log_ns, message))
    if messages.get(WHEELS):
        return _wheels(messages[WHEELS])
    if messages.get(JOINTS):
        commands = next((messages[name] for name in COMMANDS if messages.get(name)), [])
        return _joints(path, messages[JOINTS], commands)
    raise ThumperError(
        f"{path}: no {WHEELS} or {JOINTS} messages in it; record one of them", exit_code=EXIT_CHECK_FAILED
    )


def _wheels(messages: list[tuple[int, Any]]) -> LogTable:
    from thumper.ros.from_ros import telemetry_of

    samples = [telemetry_of(message).telemetry for _, message in messages]
    time_s = np.unwrap(np.array([1e-6 * t.time_us for t in samples]), period=2.0**32 * 1e-6)
    rows = [(t.left_pwm, t.left_count, t.right_pwm, t.right_count) for t in samples]
    return LogTable(headers=WHEEL_HEADERS, values=np.column_stack((time_s, np.array(rows, dtype=float))))


def _joints(path: Path, joints: list[tuple[int, Any]], commands: list[tuple[int, Any]]) -> LogTable:
    names = [str(name) for name in joints[0][1].name]
    joints = [(log_ns, m) for log_ns, m in joints if [str(name) for name in m.name] == names]
    time_ns = np.array([_stamp_ns(message) or log_ns for log_ns, message in joints], dtype=float)
    columns: list[FloatArray] = [1e-9 * (time_ns - time_ns[0])]
    headers, notes = ["time_s"], []
    logged_ns = np.array([log_ns for log_ns, _ in joints])
    for k, name in enumerate(names):
        motor = f"m{k + 1}_" if len(names) > 1 else ""
        measured = "velocity" if all(len(m.velocity) > k for _, m in joints) else "position"
        if commands:
            drive, unit = _held(commands, logged_ns, k), "command"
        elif all(len(m.effort) > k for _, m in joints):
            drive, unit = np.array([m.effort[k] for _, m in joints], dtype=float), "effort"
        else:
            raise ThumperError(
                f"{path}: JointState without effort, and no command topic: the drive is unknown",
                exit_code=EXIT_CHECK_FAILED,
            )
        output = "position_rad" if all(len(m.position) > k for _, m in joints) else "speed_rad_s"
        field = "position" if output == "position_rad" else measured
        headers += [f"{motor}voltage_V", f"{motor}{output}"]
        columns += [drive, np.array([getattr(m, field)[k] for _, m in joints], dtype=float)]
        notes.append(f"{motor or 'the motor '}is joint {name!r}; its drive is the {unit}, taken as volts")
    return LogTable(headers=tuple(headers), values=np.column_stack(columns), notes=tuple(notes))


def _stamp_ns(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _held(commands: list[tuple[int, Any]], at_ns: FloatArray, joint: int) -> FloatArray:
    """Return the command that held at each time; zero before the first."""
    values = []
    for _, message in commands:
        data = np.atleast_1d(np.asarray(message.data, dtype=float))
        values.append(data[joint] if joint < len(data) else data[-1])
    index = np.searchsorted(np.array([log_ns for log_ns, _ in commands]), at_ns, side="right") - 1
    held: FloatArray = np.where(index >= 0, np.array(values)[np.clip(index, 0, None)], 0.0)
    return held
