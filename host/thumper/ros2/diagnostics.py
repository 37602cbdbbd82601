"""Summarize the robot's status as ROS diagnostics. Pure."""

from thumper.ros.codec import Message, message
from thumper.ros.from_ros import stamp_ns_of

OK, WARN, ERROR = 0, 1, 2  # levels of diagnostic_msgs/DiagnosticStatus
STALE_SCAN_S = 1.0
LATE_LOOP_S = 0.1  # one cycle


def diagnostics(status: Message, battery: Message | None) -> Message:
    """Build a DiagnosticArray of the robot's parts from thumper_msgs/Status and BatteryState."""
    parts = [_board(status), _lidar(status), _localization(status), _loop(status)]
    if battery is not None:
        parts.append(_part(status, "battery", OK, f"{battery.voltage:.1f} V", voltage_V=battery.voltage))
    return message("diagnostic_msgs/msg/DiagnosticArray", header=status.header, status=parts)


def clock(status: Message) -> Message:
    """Build a Clock with the time of a status."""
    sec, nanosec = divmod(stamp_ns_of(status), 1_000_000_000)
    return message(
        "rosgraph_msgs/msg/Clock", clock=message("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
    )


def _board(status: Message) -> Message:
    level, text = OK, status.board_state.lower().replace("_", " ")
    if status.fault:
        level, text = ERROR, f"{status.fault_words}: {status.fault_cure}"
    return _part(
        status,
        "board",
        level,
        text,
        link_frames=status.link_frames,
        link_errors=status.link_errors,
        lost_edges=status.lost_edges,
        telemetry_age_s=status.telemetry_age_s,
    )


def _lidar(status: Message) -> Message:
    is_stale = not status.scan_age_s < STALE_SCAN_S  # also without any scan: inf
    text = f"no scan for {status.scan_age_s:.1f} s" if is_stale else "scans arrive"
    return _part(
        status,
        "lidar",
        ERROR if is_stale else OK,
        text,
        scans=status.lidar_scans,
        errors=status.lidar_errors,
        restarts=status.lidar_restarts,
        scan_age_s=status.scan_age_s,
    )


def _localization(status: Message) -> Message:
    level, text = (WARN, f"pose lost: {status.pose_lost}") if status.pose_lost else (OK, "pose known")
    return _part(status, "localization", level, text)


def _loop(status: Message) -> Message:
    is_late = status.loop_late_s > LATE_LOOP_S
    return _part(
        status,
        "control loop",
        WARN if is_late else OK,
        f"{status.mode}: {status.reason}" if status.reason else status.mode,
        late_s=status.loop_late_s,
        busy_s=status.loop_busy_s,
    )


def _part(status: Message, name: str, level: int, text: str, **values: float) -> Message:
    return message(
        "diagnostic_msgs/msg/DiagnosticStatus",
        level=level,
        name=f"{status.robot}: {name}",
        message=text,
        hardware_id=status.robot,
        values=[
            message("diagnostic_msgs/msg/KeyValue", key=key, value=f"{value:.6g}")
            for key, value in values.items()
        ],
    )
