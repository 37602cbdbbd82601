"""Turns of a gyroscope between samples, the effective track, and wheels that turn a robot that does not."""

import math

import pytest

from thumper.imu.sample import ImuSample
from thumper.odometry.track_estimator import TrackEstimator
from thumper.odometry.turn_buffer import TurnBuffer
from thumper.odometry.turn_slip import TurnSlip


def test_the_turns_of_any_intervals_add_up_to_the_whole_turn() -> None:
    buffer, turned_rad = TurnBuffer(), 0.0
    for k in range(1, 201):  # 100 Hz
        buffer.add(ImuSample(time_s=0.01 * k, yaw_rate_rad_s=math.sin(0.05 * k)))
        if k % 7 == 0:
            turned_rad += buffer.turn_until(0.01 * k + 0.004) or 0.0
    turned_rad += buffer.turn_until(2.0) or 0.0
    whole_rad = sum(0.01 * math.sin(0.05 * k) for k in range(8, 201))
    assert turned_rad == pytest.approx(whole_rad - 0.004 * math.sin(0.35), abs=1e-9)


def test_no_turn_spans_a_gap() -> None:
    buffer = TurnBuffer()
    turns = []
    for time_s in (0.00, 0.01, 0.02, 0.50, 0.51, 0.52):
        buffer.add(ImuSample(time_s=time_s, yaw_rate_rad_s=1.0))
        turns.append(buffer.turn_until(time_s))
    assert turns == [None, pytest.approx(0.01), pytest.approx(0.01), None, *turns[4:]]
    assert turns[4:] == pytest.approx([0.01, 0.01])
    assert buffer.turn_until(0.70) is None


def test_the_effective_track_is_found_and_offered() -> None:
    track = TrackEstimator(0.39)
    for k in range(400):
        slips = 100 <= k < 130
        track.add(0.005 if slips else 0.042 * (1.0 + 0.05 * math.sin(k)), 0.1)
    assert "0.929" in track.offer() or "0.928" in track.offer()
    assert not TrackEstimator(0.39).offer()


def test_a_track_that_fits_is_not_offered() -> None:
    track = TrackEstimator(0.39)
    for _ in range(400):
        track.add(0.1, 0.1)
    assert track.ratio is not None
    assert not track.offer()


def test_wheels_that_turn_a_robot_that_does_not_are_stuck_once() -> None:
    slip = TurnSlip()
    for _ in range(60):
        slip.add(3.0, 0.05, 0.001)
    assert (slip.slips, slip.stuck) == (1, 1)
    for _ in range(60):
        slip.add(0.0, 0.05, 0.05)
    assert not slip.is_stuck
    for _ in range(30):  # it slips, but it turns
        slip.add(3.0, 0.05, 0.02)
    assert (slip.slips, slip.stuck) == (2, 1)
