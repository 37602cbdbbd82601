"""The wheels are estimated from ordinary driving: real firmware on the simulated chip, known parameters."""

import math
from dataclasses import replace
from functools import cache
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.variants import some_of
from thumper.board.board import Board, TelemetrySample
from thumper.board.messages import Command, Fault
from thumper.common.kinematics import WheelSpeeds
from thumper.odometry.drive_train import DriveTrainEstimate, DriveTrainEstimator, WheelTick
from thumper.odometry.drive_train_monitor import MAX_RESTARTS, BoardWheelModel, DriveTrainMonitor
from thumper.runtime.state_estimator import wheel_tick
from thumper_hil.bench import simulation
from thumper_hil.chip.robot_params import RobotParams

ROBOT = RobotParams.load()
EQUAL = replace(ROBOT, motor=replace(ROBOT.motor, spread_ratio=0.0, unit_spread_ratio=0.0))
BOARD_MODEL = BoardWheelModel(ks=19.3, kv=17.12, ka=1.284)
GAIN, TIME_CONSTANT_S, FRICTION_PWM = 0.0584, 0.075, 19.3  # wild_thumper.toml


@cache
def driven(
    name: str,
    robot: RobotParams,
    seed: int,
    seconds: float,
    varied: bool = True,
    dragging: tuple[str, ...] = (),
    in_place: bool = False,
) -> list[WheelTick]:
    """Drive on the simulated chip, in curves of random speed and yaw rate, or straight on at one speed.

    With `in_place`, or with a dragging side or more, it turns in place, too.
    """
    rng = np.random.default_rng(seed)
    with patch.object(RobotParams, "load", return_value=robot):
        board = Board.open(f"sim://{name}{seed}/board?world=hall&seed={seed}&floor=wood", baud=500_000)
    for side in dragging:
        simulation(f"{name}{seed}").fault(f"wheels.{side}", "dragging")
    samples: list[TelemetrySample] = []
    try:
        board.poll(0.3)
        board.set_parameter("deceleration", 0.0)  # as the acceleration: only an emergency stop brakes harder
        board.command(Command.ARM)
        left = right = 4.0
        for tick in range(int(10 * seconds)):
            if varied and tick % 12 == 0:
                direction = 1.0 if tick % 72 < 36 else -1.0  # back and forth, or it meets a wall
                mean, half = direction * rng.uniform(1.0, 7.0), rng.choice((0.0, rng.uniform(-1.5, 1.5)))
                left, right = mean - half, mean + half
            if (in_place or dragging) and tick % 48 == 36:
                left, right = (-2.0, 2.0) if tick % 96 < 48 else (2.0, -2.0)
            board.set_wheel_speeds(WheelSpeeds(left_rad_s=left, right_rad_s=right))
            samples += board.poll(0.5)
    finally:
        board.close()
    assert samples[-1].telemetry.fault is Fault.NONE
    return [wheel_tick(sample.telemetry) for sample in samples]


def estimated(samples: list[WheelTick], left: float = 1.0) -> DriveTrainEstimate:
    """Return the estimate after these ticks, if the left bridge gives this share of its PWM."""
    estimator = DriveTrainEstimator(counts_per_rev=1200.0, delay_s=0.5 / 122)
    for tick in samples:
        estimator.add(tick._replace(left_pwm=round(tick.left_pwm / left)))
    return estimator.estimate()


@pytest.mark.parametrize("seed", some_of([1, 2, 3]))
def test_sixty_seconds_of_curves_determine_the_wheels(seed: int) -> None:
    found = estimated(driven("ordinary", EQUAL, seed, 60.0)).mean
    assert found.gain is not None
    assert found.time_constant_s is not None
    assert found.friction is not None
    assert found.gain.value == pytest.approx(GAIN, rel=0.03)
    assert found.time_constant_s.value == pytest.approx(TIME_CONSTANT_S, rel=0.10)
    assert found.friction.value == pytest.approx(FRICTION_PWM, abs=2.0)


@pytest.mark.slow
@pytest.mark.parametrize("left", [1.0, 0.9])
def test_curves_to_both_sides_determine_the_gain_of_each_side(left: float) -> None:
    """Many of the drives turn too little: their gains must be right or not determined.

    Those determined have deviations of up to 1.5 %, so an error of 3 % is no fault of the fit.
    """
    determined = 0
    for seed in range(1, 9):
        found = estimated(driven("ordinary", EQUAL, seed, 60.0), left)
        for side, gain in ((found.left, left * GAIN), (found.right, GAIN)):
            if side.gain is not None:
                determined += 1
                assert side.gain.value == pytest.approx(gain, abs=3.0 * side.gain.std)
    assert determined >= 3


@pytest.mark.parametrize("left", [0.9, 0.75])
def test_turns_in_place_determine_friction_and_time_constant_of_each_side(left: float) -> None:
    found = estimated(driven("turning", EQUAL, 1, 60.0, in_place=True), left)
    for side, friction_pwm in ((found.left, FRICTION_PWM / left), (found.right, FRICTION_PWM)):
        assert side.friction is not None
        assert side.time_constant_s is not None
        assert side.friction.value == pytest.approx(friction_pwm, abs=3.0)
        assert side.time_constant_s.value == pytest.approx(TIME_CONSTANT_S, rel=0.10)


def test_a_constant_speed_determines_nothing() -> None:
    found = estimated(driven("constant", EQUAL, 1, 60.0, varied=False))
    for wheels in (found.mean, found.left, found.right):
        assert wheels.gain is None
        assert wheels.time_constant_s is None
        assert wheels.friction is None


def test_missing_telemetry_is_left_out() -> None:
    samples = driven("ordinary", EQUAL, 1, 60.0)
    kept = [sample for k, sample in enumerate(samples) if k % 40 != 39]
    found = estimated(kept).mean
    assert found.gain is not None
    assert found.gain.value == pytest.approx(GAIN, rel=0.03)


def monitored(samples: list[WheelTick], model: BoardWheelModel = BOARD_MODEL) -> list[str]:
    monitor = DriveTrainMonitor(counts_per_rev=1200.0, pwm_frequency_Hz=122.0, feed_forward=model)
    for tick in samples:
        monitor.add(tick)
    return list(monitor.warnings().values())


def test_a_robot_as_the_board_knows_it_has_no_drift() -> None:
    for seed in (1, 2, 3):
        assert monitored(driven("ordinary", EQUAL, seed, 60.0)) == []


def test_dragging_wheels_are_reported_with_the_friction() -> None:
    drags = replace(EQUAL, motor=replace(EQUAL.motor, coulomb_Nm=2.0 * EQUAL.motor.coulomb_Nm))
    (line,) = monitored(driven("drags", drags, 1, 60.0))
    assert "PWM against friction, ks is 19" in line
    assert float(line.split(" PWM")[0].split()[-1]) == pytest.approx(2.0 * FRICTION_PWM, abs=3.0)
    assert "both sides drag, or carpet or a load does" in line
    assert "run `thumper tune`" in line


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_dragging_wheel_is_reported_with_its_side(side: str) -> None:
    """Its friction is 2.5 times that of the other side: 29 PWM more."""
    lines = monitored(driven(f"drags_{side}", EQUAL, 1, 45.0, dragging=(side,)))
    (line,) = (line for line in lines if line.startswith(f"the {side} side needs"))
    assert float(line.split(" PWM")[0].split()[-1]) == pytest.approx(1.5 * FRICTION_PWM, abs=6.0)
    assert f"a wheel drags on the {side}" in line
    assert not any("both sides" in other for other in lines)


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_weak_bridge_is_reported_with_its_side_and_not_as_a_drag(side: str) -> None:
    """It gives a third less: its friction takes 9.5 PWM more than that of the other side."""
    samples = driven("turning", EQUAL, 1, 60.0, in_place=True)
    weak = [tick._replace(**{f"{side}_pwm": round(getattr(tick, f"{side}_pwm") * 1.5)}) for tick in samples]
    lines = monitored(weak)
    (line,) = (line for line in lines if line.startswith(f"the {side} side turns"))
    assert float(line.split(" % slower")[0].split()[-1]) == pytest.approx(100.0 / 3.0, abs=6.0)
    assert "bridge, cables or motors are weak" in line
    assert not any("drag" in other or "weak battery" in other for other in lines)


def test_equal_sides_are_not_reported() -> None:
    assert monitored(driven("turning", EQUAL, 1, 60.0, in_place=True)) == []


def test_two_dragging_sides_are_not_taken_for_one() -> None:
    lines = monitored(driven("drags_both", EQUAL, 1, 45.0, dragging=("left", "right")))
    assert any("both sides drag, or carpet" in line for line in lines)
    assert not any("a wheel drags on the" in line for line in lines)


def test_other_gains_on_the_board_are_reported() -> None:
    samples = driven("ordinary", EQUAL, 1, 60.0)
    (line,) = monitored(samples, replace(BOARD_MODEL, kv=1.2 * BOARD_MODEL.kv, ka=2.0 * BOARD_MODEL.ka))
    assert "faster than kv says" in line
    assert "time constant" in line
    assert monitored(samples, BoardWheelModel(ks=0.0, kv=0.0, ka=0.0)) == []  # a board without a model


COUNTS = st.integers(-(2**31), 2**31 - 1)
PWM = st.integers(-32768, 32767)
STEP_US = st.sampled_from((100_000, 100_001, 0, 2**32 - 1, 5_000))
TICKS = st.builds(WheelTick, STEP_US, COUNTS, COUNTS, PWM, PWM, st.floats(0.0, 65.0))


@settings(max_examples=20, deadline=None)
@given(st.lists(TICKS, min_size=50, max_size=60))
def test_arbitrary_ticks_after_a_drive_neither_raise_nor_give_nonsense(ticks: list[WheelTick]) -> None:
    monitor = DriveTrainMonitor(counts_per_rev=1200.0, pwm_frequency_Hz=122.0, feed_forward=BOARD_MODEL)
    samples = driven("ordinary", EQUAL, 1, 60.0)
    for tick in samples:
        monitor.add(tick)
    time_us = samples[-1].time_us
    for tick in ticks:
        time_us = (time_us + tick.time_us) % 2**32
        monitor.add(tick._replace(time_us=time_us))
        monitor.warnings()
    assert monitor.failure == ""
    assert monitor.estimate is not None
    for wheels in (monitor.estimate.mean, monitor.estimate.left, monitor.estimate.right):
        for found in (wheels.gain, wheels.time_constant_s, wheels.friction):
            assert found is None or (math.isfinite(found.value) and math.isfinite(found.std))


def test_an_error_in_the_estimate_does_not_reach_the_loop() -> None:
    monitor = DriveTrainMonitor(counts_per_rev=1200.0, pwm_frequency_Hz=122.0, feed_forward=BOARD_MODEL)
    samples = driven("ordinary", EQUAL, 1, 60.0)
    with patch.object(DriveTrainEstimator, "add", side_effect=ValueError("no")):
        monitor.add(samples[0])
    assert "starts again (ValueError: no)" in monitor.warnings()["WHEELS_FAILED"]
    for tick in samples:
        monitor.add(tick)
    assert monitor.estimate is not None
    assert monitor.estimate.mean.gain is not None


def test_an_estimate_that_fails_again_and_again_says_that_it_stopped() -> None:
    monitor = DriveTrainMonitor(counts_per_rev=1200.0, pwm_frequency_Hz=122.0, feed_forward=BOARD_MODEL)
    samples = driven("ordinary", EQUAL, 1, 60.0)
    with patch.object(DriveTrainEstimator, "add", side_effect=ValueError) as add:
        for tick in samples:
            monitor.add(tick)
    assert add.call_count == MAX_RESTARTS + 1
    assert "it stopped" in monitor.warnings()["WHEELS_STOPPED"]
    assert monitor.estimate is None
