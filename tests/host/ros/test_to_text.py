"""Output of `thumper watch`: one line per message, values with units."""

import math
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from benchmarks.shared.recorded_run import MESSAGES as DATED
from benchmarks.shared.recorded_run import telemetry

from thumper.board.messages import Fault, State
from thumper.camera.frame import CameraFrame
from thumper.common.geometry import Pose2, Twist2
from thumper.gps.fix import Fix, FixStatus
from thumper.imu.sample import ImuSample
from thumper.lidar.scan import Scan
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.odometry.wheel_odometry import OdometrySample
from thumper.ros.codec import message
from thumper.ros.markers import object_markers
from thumper.ros.status import Status
from thumper.ros.to_json import from_json, to_json
from thumper.ros.to_ros import INFO, Messages, flag, text
from thumper.ros.to_text import message_text

SIMULATED = Messages()
HERE = Pose2(x_m=0.554, y_m=-0.046, theta_rad=math.radians(2.8))
PLACE = "x 0.554 m, y -0.046 m, heading 2.8 deg"
COVARIANCE = np.diag([0.0004, 0.0009, math.radians(0.5) ** 2])
ODOMETRY = OdometrySample(
    time_s=5.302, odom_from_base=HERE, twist=Twist2(v_m_s=0.359, w_rad_s=-0.027), covariance=COVARIANCE
)
SCAN = Scan(
    time_s=3.5,
    ranges_m=np.array([np.nan, 2.0, 0.75, 9.0, np.inf]),
    angle_min_rad=math.radians(-20.0),
    angle_increment_rad=math.radians(10.0),
    time_increment_s=0.0,
    range_min_m=0.02,
    range_max_m=5.6,
)


def fix(status: FixStatus, std_m: float) -> Fix:
    return Fix(
        time_s=1.0,
        status=status,
        latitude_deg=48.2625018,
        longitude_deg=11.6681078,
        variances_m2=(std_m**2, 0.25 * std_m**2, std_m**2),
    )


INERTIAL = ImuSample(
    time_s=2.0,
    yaw_rate_rad_s=0.25,
    roll_rad=math.radians(1.0),
    pitch_rad=math.radians(-2.0),
    yaw_rad=math.radians(90.0),
    acceleration_m_s2=(-0.04, 0.2, 9.8),
)
JPEG = cv2.imencode(".jpg", np.zeros((48, 64), np.uint8))[1].tobytes()
CELLS = np.array([[-1, 0, 100], [-1, 0, 0]], dtype=np.int8)
GRID = OccupancyGrid(cells=CELLS, resolution_m=0.05, origin_x_m=-1.0, origin_y_m=0.5)
STATUS = Status(
    time_s=4.0,
    mode="driving",
    reason="on its way",
    has_goal=True,
    distance_to_goal_m=1.25,
    board_state="CLOSED_LOOP",
)
MOVING = telemetry(2.0, 7)
STALLED = replace(MOVING, telemetry=replace(MOVING.telemetry, state=State.FAULT, fault=Fault.STALL_LEFT))
SAMPLES: list[tuple[Any, str]] = [
    (SIMULATED.battery(telemetry(2.0, 7)), "2.00 s: 7.60 V, 0.61 A drawn by the motors"),
    (
        SIMULATED.wheels(telemetry(2.0, 7)),
        "2.00 s: left 1.00 of 1.10 rad/s, PWM 70, 0.30 A; right 1.00 of 1.10 rad/s, PWM 71, 0.31 A; "
        "7.60 V; closed_loop",
    ),
    (
        SIMULATED.wheels(STALLED),
        "2.00 s: left 1.00 of 1.10 rad/s, PWM 70, 0.30 A; right 1.00 of 1.10 rad/s, PWM 71, 0.31 A; "
        "7.60 V; fault: left wheels stalled",
    ),
    (SIMULATED.pose(1.0, HERE), f"1.00 s: {PLACE}"),
    (SIMULATED.pose(1.0, HERE, COVARIANCE), f"1.00 s: {PLACE}; sigma 0.020 m, 0.030 m, 0.50 deg"),
    (
        SIMULATED.odometry(ODOMETRY),
        f"5.30 s: {PLACE}; sigma 0.020 m, 0.030 m, 0.50 deg; 0.359 m/s, -0.027 rad/s",
    ),
    (SIMULATED.twist(1.0, Twist2(v_m_s=0.3)), "1.00 s: 0.300 m/s, 0.000 rad/s"),
    (
        SIMULATED.transforms(1.0, Pose2(), HERE),
        f"1.00 s: map -> odom x 0.000 m, y 0.000 m, heading 0.0 deg; odom -> base_link {PLACE}",
    ),
    (SIMULATED.fix(fix(FixStatus.NONE, math.nan)), "1.00 s: no fix"),
    (
        SIMULATED.fix(fix(FixStatus.RTK, 0.02)),
        "1.00 s: 48.2625018, 11.6681078 deg; RTK fix, sigma 0.02 m",
    ),
    (
        SIMULATED.fix(fix(FixStatus.RTK_FLOAT, 0.32)),
        "1.00 s: 48.2625018, 11.6681078 deg; RTK float, sigma 0.32 m",
    ),
    (
        SIMULATED.fix_in_map(fix(FixStatus.RTK, 0.02), 1.25, -0.5),
        "1.00 s: x 1.250 m, y -0.500 m; sigma 0.020 m",
    ),
    (SIMULATED.imu(ImuSample(time_s=2.0, yaw_rate_rad_s=-0.25)), "2.00 s: turn -0.250 rad/s"),
    (
        SIMULATED.imu(INERTIAL),
        "2.00 s: turn 0.250 rad/s; roll 1.0 deg, pitch -2.0 deg, yaw 90.0 deg; "
        "acceleration -0.04, 0.20, 9.80 m/s^2",
    ),
    (
        SIMULATED.image(CameraFrame(time_s=2.0, jpeg=JPEG)),
        f"2.00 s: 64 x 48 pixels, jpeg, {1e-3 * len(JPEG):.1f} kB",
    ),
    (
        SIMULATED.image(CameraFrame(time_s=2.0, jpeg=3000 * b"x")),
        "2.00 s: jpeg, 3.0 kB; the frame is not a JPEG image",
    ),
    (SIMULATED.scan(SCAN), "3.50 s: 2 of 5 beams hit, nearest at 0.750 m, 0 deg"),
    (SIMULATED.grid(2.0, GRID), "2.00 s: 3 x 2 cells of 0.05 m from x -1.00 m, y 0.50 m; 67% known"),
    (
        SIMULATED.path(2.0, np.array([[0.0, 0.0], [3.0, 4.0]])),
        "2.00 s: 2 points, 5.00 m to x 3.00 m, y 4.00 m",
    ),
    (SIMULATED.path(2.0, np.empty((0, 2))), "2.00 s: no points"),
    (
        SIMULATED.particles(2.0, np.array([[1.0, 0.0, 0.0], [3.0, 0.0, 0.0]])),
        "2.00 s: 2 around x 2.00 m, y 0.00 m; standard deviation 1.000 m, 0.000 m",
    ),
    (
        SIMULATED.status(STATUS),
        "4.00 s: driving (on its way), 1.25 m to go; board armed; loop 0.0 ms late, busy for 0.0 ms",
    ),
    (
        SIMULATED.status(
            Status(
                time_s=4.0,
                board_state="FAULT",
                fault=1,
                fault_words="link lost",
                fault_cure="is it plugged in?",
            )
        ),
        "4.00 s: fault; board fault, link lost: is it plugged in?; loop 0.0 ms late, busy for 0.0 ms",
    ),
    (SIMULATED.event(3.0, INFO, "a wheel slips", "robot"), "3.00 s: robot: a wheel slips"),
    (
        object_markers(SIMULATED, 2.0, [("chair", 1.0, -0.5), ("potted plant", 2.0, 0.0)]),
        "chair (1.00, -0.50), potted plant (2.00, 0.00)",
    ),
    (object_markers(SIMULATED, 2.0, []), "none"),
    (text("cancel"), "cancel"),
    (flag(True), "true"),
]


@pytest.mark.parametrize(
    ("sample", "line"), SAMPLES, ids=[sample.__msgtype__.rpartition("/")[2] for sample, _ in SAMPLES]
)
def test_line_has_values_and_units(sample: Any, line: str) -> None:
    assert message_text(sample) == line
    assert (
        from_json(sample.__msgtype__, to_json(sample)).__msgtype__ == sample.__msgtype__
    )  # no unknown field


def test_real_time_stamps_show_the_time_of_day() -> None:
    clock, _, words = message_text(DATED.battery(telemetry(2.0, 7))).partition(": ")
    assert words.startswith("7.60 V")
    assert [part.isdigit() for part in clock.replace(".", ":").split(":")] == 4 * [True]


def test_invalid_and_unknown_messages_are_listed_by_field() -> None:
    assert message_text(message("builtin_interfaces/msg/Duration", sec=3, nanosec=5)) == "sec: 3, nanosec: 5"
    askew = SIMULATED.pose(1.0, HERE)
    askew.pose.pose.orientation.w = 5.0
    assert "pose.pose.orientation.w: 5.0" in message_text(askew)
