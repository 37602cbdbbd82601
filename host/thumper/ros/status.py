"""The robot's status summary: content of the topic `status`."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Status:
    """State of the whole robot; the fields are those of thumper_msgs/msg/Status."""

    time_s: float
    robot: str = ""
    mode: str = "idle"  # idle, holding, driving, manual, stopping, experiment
    reason: str = ""  # why, as text
    simulated: bool = False
    recording: bool = False  # also while it is paused
    recording_paused: bool = False  # until the disk has room again
    has_goal: bool = False
    goal_x_m: float = 0.0
    goal_y_m: float = 0.0
    goal_yaw_rad: float = 0.0  # NaN: any heading
    distance_to_goal_m: float = 0.0
    board_state: str = ""  # DISARMED, CLOSED_LOOP, MANUAL or FAULT
    fault: int = 0  # latched fault of the board; 0 none
    fault_words: str = ""
    fault_cure: str = ""
    loop_late_s: float = 0.0  # how late the previous cycle started
    loop_busy_s: float = 0.0  # how long the previous cycle took
    telemetry_age_s: float = 0.0
    scan_age_s: float = 0.0
    link_frames: int = 0  # good frames that the board received since its reset; wraps at 65536
    link_errors: int = 0
    lost_edges: int = 0
    lidar_scans: int = 0
    lidar_errors: int = 0
    lidar_restarts: int = 0
    sensors: str = ""  # the others: name, samples, errors and restarts of each
    pose_lost: str = ""  # why the pose cannot be trusted; empty if it can
    localization: str = ""  # mapping, searching, localized, pose lost, pose lost while mapping
