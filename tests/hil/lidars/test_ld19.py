"""Test the LD19 driver against the simulated LD19, byte for byte, on simulated time."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import cast

import numpy as np
import pytest
import serial

from tests.hil.lidars.memory_port import MemoryPort, standing
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.common.serial_port import SerialPort
from thumper.lidar.deskew import scan_points
from thumper.lidar.ld19 import Ld19Driver, Ld19Options
from thumper.lidar.ld19_protocol import Ld19Decoder
from thumper.lidar.scan import Scan
from thumper_hil.lidars.beams import UNDISTURBED
from thumper_hil.lidars.ld19 import Ld19
from thumper_hil.world.world import World

ROOM = World.load("lab")
MOUNT = Pose2(x_m=0.12)
POLL_S = 0.02


def turning(times_s: FloatArray) -> FloatArray:
    still = np.zeros_like(times_s)
    return np.column_stack([still, still, 2.0 * times_s])


def connect(
    pose_at: Callable[[FloatArray], FloatArray] = standing,
    *,
    world: World = ROOM,
    options: Ld19Options | None = None,
    seed: int = 1,
    drift: float = 0.0,
) -> tuple[MemoryPort[Ld19], Ld19Driver]:
    conditions = replace(UNDISTURBED, clock_drift=drift)
    lidar = Ld19(world=world, pose_at=pose_at, base_from_laser=MOUNT, seed=seed, conditions=conditions)
    port = MemoryPort(lidar)
    return port, Ld19Driver(SerialPort(cast("serial.Serial", port)), options=options)


def scans_of(port: MemoryPort[Ld19], driver: Ld19Driver, seconds: float) -> Iterator[Scan]:
    for _ in range(round(seconds / POLL_S)):
        port.pass_time(POLL_S)
        yield from driver.poll()


def truth_m(scan: Scan, pose_at: Callable[[FloatArray], FloatArray], angle_error_rad: float) -> FloatArray:
    """Return the ranges of a perfect lidar at the scan's time stamps and angles."""
    times_s = scan.time_s + np.arange(scan.ranges_m.size) * scan.time_increment_s
    poses = pose_at(times_s.astype(np.float64))
    x_m = poses[:, 0] + MOUNT.x_m * np.cos(poses[:, 2])
    y_m = poses[:, 1] + MOUNT.x_m * np.sin(poses[:, 2])
    return ROOM.cast(x_m, y_m, poses[:, 2] + scan.angles_rad() + angle_error_rad)


def test_scan_is_clockwise_complete_and_correct() -> None:
    port, driver = connect()
    scans = list(scans_of(port, driver, 2.0))
    assert 18 <= len(scans) <= 20
    scan = scans[-1]
    assert 445 <= scan.ranges_m.size <= 455
    assert scan.angle_increment_rad < 0.0
    assert scan.angle_min_rad == pytest.approx(math.pi, abs=0.02), "a scan starts at the rear"
    assert scan.angle_increment_rad * scan.ranges_m.size == pytest.approx(-math.tau, rel=0.01)
    assert scan.time_increment_s == pytest.approx(1 / 4500, rel=0.02)
    assert (scan.range_min_m, scan.range_max_m) == (0.02, 12.0)
    error_m = scan.ranges_m - truth_m(scan, standing, port.lidar._angle_error_rad)
    assert np.isfinite(error_m).all()
    assert abs(np.median(error_m) - port.lidar._bias_m) < 0.003
    assert np.median(np.abs(error_m - np.median(error_m))) / 0.6745 == pytest.approx(0.010, rel=0.2)


def test_time_stamps_are_right_while_turning() -> None:
    """At 2 rad/s a time stamp error of 10 ms would shift the room by 1.1 degrees."""
    port, driver = connect(turning)
    for scan in list(scans_of(port, driver, 35.0))[10:]:  # includes a wrap of the sensor's clock
        error_m = scan.ranges_m - truth_m(scan, turning, port.lidar._angle_error_rad) - port.lidar._bias_m
        turned_m = (
            scan.ranges_m - truth_m(scan, lambda t: turning(t + 0.01), port.lidar._angle_error_rad)
        ) - port.lidar._bias_m
        assert np.median(np.abs(error_m)) < 0.011
        assert np.median(np.abs(error_m)) < np.median(np.abs(turned_m))


@pytest.mark.slow
@pytest.mark.parametrize("drift", [0.005, -0.005])
def test_time_stamps_follow_a_drifting_clock(drift: float) -> None:
    port, driver = connect(turning, drift=drift)
    for scan in list(scans_of(port, driver, 20.0))[100::20]:
        errors_m = [
            np.median(np.abs(scan.ranges_m - truth_m(scan, turned_later, port.lidar._angle_error_rad)))
            for turned_later in (lambda t: turning(t - 0.02), turning, lambda t: turning(t + 0.02))
        ]
        assert np.argmin(errors_m) == 1


def test_deskewing_works_for_a_clockwise_lidar() -> None:
    """Corrected points of a turning robot are on the walls; uncorrected or reversed ones are not."""
    port, driver = connect(turning)
    scan = list(scans_of(port, driver, 2.0))[-1]
    start = turning(np.array([scan.time_s]))[0]
    base = Pose2(x_m=start[0], y_m=start[1], theta_rad=start[2])

    def wall_error_m(rate_rad_s: float) -> float:
        mount = Pose2(x_m=MOUNT.x_m, theta_rad=port.lidar._angle_error_rad)
        points = scan_points(scan, Twist2(w_rad_s=rate_rad_s), mount, 12.0).hits_m
        ends_m = base.apply(points)
        outline = np.array([[0.0, 0.0], [1e-4, 0.0], [0.0, 1e-4], [1e-4, 1e-4]])
        near = [ROOM.clearance_m(Pose2(x_m=x, y_m=y), outline) for x, y in ends_m[::5]]
        return float(np.median(near))

    right_m, none_m, backwards_m = (wall_error_m(rate) for rate in (2.0, 0.0, -2.0))
    assert right_m < 0.03
    assert none_m > 2.0 * right_m
    assert backwards_m > none_m


def test_lost_bytes_leave_gaps_but_no_distortion() -> None:
    port, driver = connect()
    list(scans_of(port, driver, 0.5))
    rng = np.random.default_rng(3)

    def lose(data: bytes) -> bytes:
        at = int(rng.integers(0, max(len(data) - 60, 1)))
        return data[:at] + data[at + 60 :] if rng.random() < 0.3 else data

    port.spoil = lose
    scans = list(scans_of(port, driver, 3.0))
    assert len(scans) >= 25
    assert driver.counters.bad_replies > 10
    for scan in scans:
        error_m = scan.ranges_m - truth_m(scan, standing, port.lidar._angle_error_rad) - port.lidar._bias_m
        assert 360 <= scan.ranges_m.size <= 455, "losses at its ends shorten a scan"
        assert scan.angle_increment_rad == pytest.approx(-math.tau / 450, rel=0.015)
        assert np.nanmedian(np.abs(error_m)) < 0.011
    assert any(np.isnan(scan.ranges_m).any() for scan in scans)


def test_no_scan_mixes_data_from_before_and_after_a_gap() -> None:
    port, driver = connect()
    list(scans_of(port, driver, 0.5))
    port.spoil = lambda data: b""
    assert list(scans_of(port, driver, 0.33)) == []
    port.spoil = lambda data: data
    for scan in scans_of(port, driver, 0.5):
        assert 445 <= scan.ranges_m.size <= 455


def test_unplugged_lidar_never_raises() -> None:
    port, driver = connect()
    port.unplugged = True
    assert list(scans_of(port, driver, 1.0)) == []
    assert driver.counters.port_errors > 10


def test_zero_and_weak_echoes() -> None:
    nothing = World(segments_m=np.array([[99.0, 99.0, 99.0, 99.5]]), circles_m=np.zeros((0, 3)))
    port, driver = connect(world=nothing)
    assert np.isnan(list(scans_of(port, driver, 0.5))[-1].ranges_m).all()
    port, driver = connect(world=nothing, options=Ld19Options(zero_as_no_return=True))
    assert np.isposinf(list(scans_of(port, driver, 0.5))[-1].ranges_m).all()
    port, driver = connect(options=Ld19Options(min_intensity=201))
    assert np.isnan(list(scans_of(port, driver, 0.5))[-1].ranges_m).all()


def test_frames_do_not_depend_on_the_step_size() -> None:
    def run(step_s: float, seed: int) -> bytes:
        lidar = Ld19(world=ROOM, pose_at=standing, base_from_laser=MOUNT, seed=seed)
        data = b""
        for step in range(round(0.4 / step_s)):
            lidar.advance((step + 1) * step_s)
            data += lidar.read()
        return data

    assert run(0.001, 3) == run(0.05, 3)
    assert run(0.05, 3) != run(0.05, 4)
    assert len(Ld19Decoder().feed(run(0.05, 3))) == 149, (
        "375 frames per second, the last is still on the wire"
    )
