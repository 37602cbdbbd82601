"""Read MCAP recordings: the wheels topic of Thumper, or JointState and a command of another ROS 2 robot."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.logs.table import LogTable
from thumper_tuning.logs.units import log_error

WHEELS, JOINTS = "thumper_msgs/msg/Wheels", "sensor_msgs/msg/JointState"
NUMBERS = re.compile(r"std_msgs/msg/(Float|U?Int)(8|16|32|64)(MultiArray)?")
COMMAND_NAMES = re.compile(r"cmd|command|pwm|duty|volt|effort|drive|motor|input|throttle|(^|[/_])u($|[/_])")
NO_COMMAND = re.compile(r"batt|vbat|current|temp|setpoint|target|speed|vel|odom")
WHEEL_HEADERS = ("time_s", "left_pwm", "left_counts", "right_pwm", "right_counts")
# The unit of a drive whose topic does not name it, by its largest value: motors of 12, 24 and 48 V are below.
MAX_DUTY, MAX_VOLTS = 1.0, 60.0
UNITS = {"V": "volts", "pwm": "PWM of 255", "duty": "duty ratio"}

Messages = list[tuple[int, Any]]
"""Log time [ns] and message, of one topic."""


def read_mcap_table(path: Path) -> LogTable:
    """Return the wheels of a Thumper recording, or the joints of another robot.

    The drive of a joint is its command (a number in `std_msgs`, or its place in an array), else its effort.

    Raises
    ------
    ThumperError
        The file is not MCAP, has no such messages, or does not show which topic drives a joint.
    """
    from thumper.recording.reader import Recording  # loads the ROS 2 types

    topics: dict[str, dict[str, Messages]] = {WHEELS: {}, JOINTS: {}, "": {}}
    recording = Recording((path,))
    for recorded in recording.messages():
        kind = "" if NUMBERS.fullmatch(recorded.type_name) else recorded.type_name
        if kind in topics:
            try:
                message = recorded.decode()
            except (ValueError, KeyError):
                continue  # a damaged message
            topics[kind].setdefault(recorded.topic, []).append((recorded.log_ns, message))
    damage = tuple(f"damaged file: {note}" for note in recording.notes)
    if topics[WHEELS]:
        return replace(_wheels(_longest(topics[WHEELS])), notes=damage)
    if topics[JOINTS]:
        return replace(_joints(path, _longest(topics[JOINTS]), topics[""]), notes=damage)
    if damage:
        raise log_error(
            f"{path}: {damage[0]}; its readable part has no {WHEELS} or {JOINTS} messages, and "
            "`thumper recover` finds no more; copy the file again, or record again"
        )
    raise log_error(f"{path}: no {WHEELS} or {JOINTS} messages in it; record one of them")


def _longest(topics: dict[str, Messages]) -> Messages:
    return max(topics.values(), key=len)


def _wheels(messages: Messages) -> LogTable:
    from thumper.ros.from_ros import telemetry_of

    samples = [telemetry_of(message).telemetry for _, message in messages]
    time_s = np.unwrap(np.array([1e-6 * t.time_us for t in samples]), period=2.0**32 * 1e-6)
    rows = [(t.left_pwm, t.left_count, t.right_pwm, t.right_count) for t in samples]
    return LogTable(headers=WHEEL_HEADERS, values=np.column_stack((time_s, np.array(rows, dtype=float))))


def _joints(path: Path, joints: Messages, numbers: dict[str, Messages]) -> LogTable:
    names = [str(name) for name in joints[0][1].name]
    joints = [(log_ns, m) for log_ns, m in joints if [str(name) for name in m.name] == names]
    time_ns = np.array([_stamp_ns(message) or log_ns for log_ns, message in joints], dtype=float)
    columns: list[FloatArray] = [1e-9 * (time_ns - time_ns[0])]
    headers, notes = ["time_s"], {}
    logged_ns = np.array([log_ns for log_ns, _ in joints])
    for k, name in enumerate(names):
        fields = (f for f in ("position", "velocity") if all(len(getattr(m, f)) > k for _, m in joints))
        output = next(fields, "")
        if not output:
            raise log_error(f"{path}: joint {name!r} has neither positions nor velocities")
        topic = _command_topic(path, numbers, name, len(names))
        if topic:
            drive, source = _held(numbers[topic], logged_ns, k), topic
        elif all(len(m.effort) > k for _, m in joints):
            drive, source = np.array([m.effort[k] for _, m in joints], dtype=float), "its effort"
        else:
            raise log_error(f"{path}: JointState without effort, and no command topic: the drive is unknown")
        motor = f"m{k + 1}_" if len(names) > 1 else ""
        unit = _unit(topic, drive)
        header = f"{motor}{'command' if topic else 'effort'}_{unit}"
        headers += [header, f"{motor}position_rad" if output == "position" else f"{motor}speed_rad_s"]
        columns += [drive, np.array([getattr(m, output)[k] for _, m in joints], dtype=float)]
        notes[header] = (
            f"{motor.rstrip('_') or 'the motor'} is joint {name!r}, its drive is {source}, taken as "
            f"{UNITS[unit]}; else pass --column drive={header}:UNIT"
        )
    return LogTable(headers=tuple(headers), values=np.column_stack(columns), drive_notes=notes)


def _command_topic(path: Path, numbers: dict[str, Messages], joint: str, joints: int) -> str:
    """Return the topic that drives the joint; empty: none of the topics looks like a command."""
    possible = [topic for topic in numbers if not NO_COMMAND.search(topic.lower())]
    found = [topic for topic in possible if COMMAND_NAMES.search(topic.lower())]
    if not found and len(possible) == 1:
        found = possible
    stem = joint.lower().removesuffix("_joint")
    own = [topic for topic in found if stem in topic.lower()] or found
    if len(own) > 1 or (own and joints > 1 and own == found and not hasattr(numbers[own[0]][0][1], "layout")):
        raise log_error(
            f"{path}: which topic drives joint {joint!r}: {', '.join(own)}? Name it "
            "after the joint, or record an array with one number per joint"
        )
    return own[0] if own else ""


def _unit(topic: str, drive: FloatArray) -> str:
    """Return the unit that the topic names, else the one that the size suggests."""
    for word, unit in (("pwm", "pwm"), ("volt", "V"), ("duty", "duty")):
        if word in topic.lower():
            return unit
    largest = float(np.abs(drive).max(initial=0.0))
    return "duty" if largest <= MAX_DUTY else "V" if largest <= MAX_VOLTS else "pwm"


def _stamp_ns(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _held(commands: Messages, at_ns: FloatArray, joint: int) -> FloatArray:
    """Return the command that held at each time; zero before the first."""
    values = []
    for _, message in commands:
        data = np.atleast_1d(np.asarray(message.data, dtype=float))
        values.append(data[joint] if joint < len(data) else data[-1])
    index = np.searchsorted(np.array([log_ns for log_ns, _ in commands]), at_ns, side="right") - 1
    held: FloatArray = np.where(index >= 0, np.array(values)[np.clip(index, 0, None)], 0.0)
    return held
