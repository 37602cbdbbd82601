"""Data converted to a ROS 2 message and back is unchanged."""

import math
import sys
from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thumper.board.board import TelemetrySample
from thumper.board.messages import Fault, GyroscopeState, State, Telemetry
from thumper.common.geometry import Pose2, Twist2
from thumper.common.stamps import epoch_ns_at, host_time_s, rounded_s, stamp_ns
from thumper.lidar.scan import Scan
from thumper.maps.occupancy_grid import MAX_CELLS, OccupancyGrid
from thumper.navigation.costmap.costmap import CostmapOptions, build_costmap
from thumper.navigation.footprint import Footprint
from thumper.odometry.wheel_odometry import OdometrySample
from thumper.ros import from_ros
from thumper.ros.codec import decode, encode
from thumper.ros.status import Status
from thumper.ros.to_ros import Messages, flag, text
from thumper.ros.topics import TOPICS

EPOCH_NS = 1_750_000_000_123_456_789
MESSAGES = Messages(epoch_ns=EPOCH_NS)


def sent(message: Any) -> Any:
    return decode(encode(message), message.__msgtype__)


@given(time_s=st.floats(0.0, 1e7), epoch_ns=st.integers(0, 2_000_000_000_000_000_000))
def test_rounded_time_survives_any_epoch(time_s: float, epoch_ns: int) -> None:
    rounded = rounded_s(time_s)
    assert abs(rounded - time_s) < 2e-9
    assert host_time_s(stamp_ns(rounded, epoch_ns), epoch_ns) == rounded
    assert rounded_s(rounded) == rounded


def test_epoch_maps_now_to_the_date() -> None:
    assert stamp_ns(123.0, epoch_ns_at(123.0)) > 1_600_000_000_000_000_000


@given(
    values=st.lists(
        st.one_of(st.floats(0.03125, 5.5, width=32), st.just(math.nan), st.just(math.inf)), min_size=1
    ),
    time_s=st.floats(0.0, 1e6),
    clockwise=st.booleans(),
)
def test_scan(values: list[float], time_s: float, clockwise: bool) -> None:
    scan = Scan(
        time_s=time_s,
        ranges_m=np.array(values),
        angle_min_rad=-2.0,
        angle_increment_rad=-0.0078125 if clockwise else 0.0078125,
        time_increment_s=2.0**-13,
        range_min_m=0.0625,
        range_max_m=5.5,
    )
    back = from_ros.scan_of(sent(MESSAGES.scan(scan)), EPOCH_NS)
    assert back.time_s == rounded_s(time_s)
    np.testing.assert_array_equal(back.ranges_m, scan.ranges_m)
    assert back.angle_increment_rad == scan.angle_increment_rad
    assert (back.angle_min_rad, back.time_increment_s) == (scan.angle_min_rad, scan.time_increment_s)
    assert (back.range_min_m, back.range_max_m) == (scan.range_min_m, scan.range_max_m)


@given(time_s=st.floats(0.0, 1e6), range_m=st.floats(0.02, 5.6))
def test_recorded_scan_is_restored_bit_for_bit(time_s: float, range_m: float) -> None:
    scan = Scan(
        time_s=time_s,
        ranges_m=np.array([range_m, math.nan, math.inf]),
        angle_min_rad=-2.0862,
        angle_increment_rad=math.tau / 1024,
        time_increment_s=0.1 / 1024,
    ).as_recorded()
    back = from_ros.scan_of(sent(MESSAGES.scan(scan)), EPOCH_NS)
    for field in fields(Scan):
        np.testing.assert_array_equal(getattr(back, field.name), getattr(scan, field.name), field.name)
    assert scan.time_s == pytest.approx(time_s, abs=1e-9)
    assert scan.ranges_m[0] == pytest.approx(range_m, rel=1e-7)


def test_scan_has_last_angle_and_revolution_time() -> None:
    scan = Scan(
        time_s=1.0,
        ranges_m=np.ones(682),
        angle_min_rad=-2.0862,
        angle_increment_rad=math.tau / 1024,
        time_increment_s=0.1 / 1024,
    )
    out = MESSAGES.scan(scan)
    assert out.header.frame_id == "laser"
    assert out.angle_max == pytest.approx(scan.angles_rad()[-1])
    assert out.scan_time == pytest.approx(0.1)


def telemetry_of_extremes() -> TelemetrySample:
    return TelemetrySample(
        time_s=12.3,
        telemetry=Telemetry(
            time_us=2**32 - 1,
            left_count=-(2**31),
            left_speed=-1,
            left_setpoint=2,
            left_pwm=-255,
            left_integral=16320,
            right_count=2**31 - 1,
            right_speed=3,
            right_setpoint=-32768,
            right_pwm=255,
            right_integral=-16320,
            lost_edges=65535,
            battery_mV=7412,
            left_current_mA=-1200,
            right_current_mA=800,
            state=State.FAULT,
            fault=Fault.OVER_CURRENT,
            warnings=1,
            rx_frames=65535,
            rx_errors=4,
            tx_dropped=0,
            heading=65535,
            gyroscope=GyroscopeState.READY,
        ),
    )


def test_telemetry_is_restored_exactly() -> None:
    sample = telemetry_of_extremes()
    assert from_ros.telemetry_of(sent(MESSAGES.wheels(sample)), EPOCH_NS) == sample


def test_battery() -> None:
    battery = sent(MESSAGES.battery(telemetry_of_extremes()))
    assert battery.voltage == pytest.approx(7.412)
    assert battery.current == pytest.approx(-2.0)
    assert math.isnan(battery.percentage)
    assert battery.present


angles = st.floats(-math.pi + 1e-6, math.pi - 1e-6)
lengths = st.floats(-100.0, 100.0)


@given(x_m=lengths, y_m=lengths, theta_rad=angles)
def test_poses(x_m: float, y_m: float, theta_rad: float) -> None:
    pose = Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)
    covariance = np.array([[1.0, 0.1, 0.2], [0.1, 2.0, 0.3], [0.2, 0.3, 3.0]])
    for message in (MESSAGES.goal(1.0, pose), MESSAGES.pose(1.0, pose, covariance).pose):
        back = from_ros.pose_of(sent(message).pose)
        assert (back.x_m, back.y_m) == (pose.x_m, pose.y_m)
        assert back.theta_rad == pytest.approx(theta_rad, abs=1e-12)
    full = sent(MESSAGES.pose(1.0, pose, covariance)).pose.covariance.reshape(6, 6)
    np.testing.assert_array_equal(full[np.ix_((0, 1, 5), (0, 1, 5))], covariance)
    assert not full[2:5].any()


def test_odometry_and_transforms_have_frames() -> None:
    pose = Pose2(x_m=1.0, y_m=2.0, theta_rad=0.5)
    sample = OdometrySample(
        time_s=4.0, odom_from_base=pose, twist=Twist2(v_m_s=0.3, w_rad_s=-0.2), covariance=np.eye(3)
    )
    out = sent(MESSAGES.odometry(sample))
    assert (out.header.frame_id, out.child_frame_id) == ("odom", "base_link")
    assert from_ros.twist_of(out.twist.twist) == sample.twist
    moving = sent(MESSAGES.transforms(4.0, Pose2(), pose)).transforms
    fixed = sent(MESSAGES.fixed_transforms(4.0, Pose2(x_m=0.12))).transforms
    tree = [(t.header.frame_id, t.child_frame_id) for t in (*moving, *fixed)]
    assert tree == [("map", "odom"), ("odom", "base_link"), ("base_link", "laser")]
    assert fixed[0].transform.translation.x == 0.12


def test_antenna_is_a_fixed_frame() -> None:
    _, gps = sent(MESSAGES.fixed_transforms(4.0, Pose2(), Pose2(x_m=-0.1, y_m=0.05))).transforms
    assert (gps.header.frame_id, gps.child_frame_id) == ("base_link", "gps")
    assert (gps.transform.translation.x, gps.transform.translation.y) == (-0.1, 0.05)


def test_grid() -> None:
    cells = np.random.default_rng(1).integers(-1, 101, (7, 5)).astype(np.int8)
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=-1.35, origin_y_m=2.2)
    back = from_ros.grid_of(sent(MESSAGES.grid(1.0, grid)))
    np.testing.assert_array_equal(back.cells, cells)
    assert (back.resolution_m, back.origin_x_m, back.origin_y_m) == (0.05, -1.35, 2.2)


def test_large_map_is_decoded() -> None:
    grid = OccupancyGrid(
        cells=np.zeros((4001, 4001), np.int8), resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0
    )
    assert grid.cells.size < MAX_CELLS
    decoded = decode(encode(MESSAGES.grid(0.0, grid)), "nav_msgs/msg/OccupancyGrid")
    assert from_ros.grid_of(decoded).cells.shape == (4001, 4001)


def test_inconsistent_grid_is_refused() -> None:
    message = MESSAGES.grid(
        0.0, OccupancyGrid(cells=np.zeros((2, 3), np.int8), resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    )
    message.info.width = 4
    with pytest.raises(ValueError, match="6 cells for 4 x 2"):
        from_ros.grid_of(message)


def test_costs_are_converted_to_percent() -> None:
    cells = np.full((60, 60), 0, dtype=np.int8)
    cells[30, 30], cells[0, 0] = 100, -1
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    costmap = build_costmap(grid, np.empty((0, 2)), Footprint(), CostmapOptions())
    out = from_ros.grid_of(sent(MESSAGES.costmap(1.0, costmap))).cells
    assert out[30, 30] == 100
    assert out[30, 31] == 99
    assert out[0, 0] == -1
    assert out[59, 59] == 0
    assert out.max() == 100


def test_path_without_headings_points_ahead() -> None:
    path = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 2.0]])
    back = from_ros.path_of(sent(MESSAGES.path(1.0, path)))
    expected = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.5 * math.pi], [1.0, 2.0, 0.5 * math.pi]])
    np.testing.assert_allclose(back, expected, atol=1e-12)
    with_headings = np.array([[0.0, 1.0, -0.5], [2.0, 3.0, 0.25]])
    np.testing.assert_allclose(from_ros.path_of(sent(MESSAGES.path(1.0, with_headings))), with_headings)
    np.testing.assert_allclose(from_ros.poses_of(sent(MESSAGES.particles(1.0, with_headings))), with_headings)
    for empty in (np.empty((0, 2)), np.empty((0, 3))):
        assert from_ros.path_of(sent(MESSAGES.path(1.0, empty))).shape == (0, 3)


def test_status_and_text() -> None:
    status = Status(
        time_s=2.5, robot="mole", mode="navigating", has_goal=True, fault=3, fault_words="pressed"
    )
    assert from_ros.status_of(sent(MESSAGES.status(status)), EPOCH_NS) == status
    assert sent(MESSAGES.event(1.0, 40, "kabel lose: ö")).msg == "kabel lose: ö"
    assert sent(text("arm")).data == "arm"
    assert sent(flag(True)).data is True


@given(
    raw=st.one_of(
        st.binary(max_size=200), st.binary(max_size=200).map(lambda tail: b"\x00\x01\x00\x00" + tail)
    ),
    name=st.sampled_from(sorted(TOPICS)),
)
def test_garbage_raises_value_error(raw: bytes, name: str) -> None:
    try:
        decode(raw, TOPICS[name].type_name)
    except ValueError:
        return


def test_giant_length_allocates_no_memory() -> None:
    raw = bytearray(encode(MESSAGES.path(1.0, np.empty((0, 2)))))
    raw[-4:] = (2**32 - 1).to_bytes(4, sys.byteorder)
    with pytest.raises(ValueError, match="Path"):
        decode(bytes(raw), "nav_msgs/msg/Path")


@pytest.mark.parametrize(
    ("x", "w", "why"), [(math.nan, 1.0, "finite"), (0.0, 0.0, "length 0"), (0.0, 2.0, "length 2")]
)
def test_invalid_pose_is_refused(x: float, w: float, why: str) -> None:
    pose = MESSAGES.goal(0.0, Pose2()).pose
    pose.position.x, pose.orientation.w = x, w
    with pytest.raises(ValueError, match=why):
        from_ros.pose_of(pose)


def test_non_finite_speed_is_refused() -> None:
    with pytest.raises(ValueError, match="finite"):
        from_ros.twist_of(MESSAGES.twist(0.0, Twist2(v_m_s=math.inf)).twist)
