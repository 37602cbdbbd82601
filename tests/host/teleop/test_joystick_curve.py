"""Joystick to speed, for every joystick state and every robot."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thumper.common.geometry import Twist2
from thumper.common.kinematics import DriveGeometry, wheel_speeds
from thumper.config.teleop import TeleopOptions
from thumper.teleop.joystick_curve import (
    V_SLEW_M_S2,
    W_SLEW_RAD_S2,
    JoystickState,
    SpeedScaler,
    apply_curve,
    joystick_twist,
)

OPTIONS, DRIVE, LIMIT = TeleopOptions(), DriveGeometry(), 13.0
axes = st.floats(-1.0, 1.0)
shares = st.floats(0.0, 0.9)
sticks = st.builds(JoystickState, forward=axes, turn=axes, enable=st.booleans(), turbo=st.booleans())


@given(value=axes, other=axes, dead_zone=shares, expo=st.floats(0.0, 1.0))
def test_the_curve_is_odd_and_monotonic_and_reaches_its_ends(
    value: float, other: float, dead_zone: float, expo: float
) -> None:
    result = apply_curve(value, dead_zone, expo)
    assert -1.0 <= result <= 1.0
    assert result == -apply_curve(-value, dead_zone, expo)
    if value <= other:
        assert result <= apply_curve(other, dead_zone, expo) + 1e-12
    if abs(value) <= dead_zone:
        assert result == 0.0
    assert apply_curve(1.0, dead_zone, expo) == pytest.approx(1.0)


def test_nan_is_centred_and_values_beyond_the_end_are_clamped() -> None:
    assert apply_curve(math.nan, 0.1, 0.3) == 0.0
    assert apply_curve(1.2, 0.1, 0.3) == pytest.approx(1.0)


@given(stick=sticks, limit=st.floats(0.5, 17.0))
def test_wheel_speeds_are_limited_at_the_same_curvature(stick: JoystickState, limit: float) -> None:
    free = joystick_twist(stick, OPTIONS, DRIVE, 1e9)
    twist = joystick_twist(stick, OPTIONS, DRIVE, limit)
    speeds = wheel_speeds(twist, DRIVE)
    assert max(abs(speeds.left_rad_s), abs(speeds.right_rad_s)) <= limit * (1.0 + 1e-9)
    assert twist.v_m_s * free.w_rad_s == pytest.approx(free.v_m_s * twist.w_rad_s, abs=1e-9)
    assert twist.v_m_s * free.v_m_s >= 0.0
    if not stick.enable:
        assert twist == Twist2()


@given(stick=sticks)
def test_turbo_is_never_slower(stick: JoystickState) -> None:
    slow = joystick_twist(JoystickState(forward=stick.forward, enable=True), OPTIONS, DRIVE, LIMIT)
    fast = joystick_twist(
        JoystickState(forward=stick.forward, enable=True, turbo=True), OPTIONS, DRIVE, LIMIT
    )
    assert abs(fast.v_m_s) >= abs(slow.v_m_s)


@given(states=st.lists(st.one_of(st.none(), sticks), max_size=40))
def test_it_drives_only_while_enabled_ramps_and_sends_zero_once(states: list[JoystickState | None]) -> None:
    scaler, period_s = SpeedScaler(OPTIONS, DRIVE, LIMIT), 0.05
    last: Twist2 | None = None
    released = False  # since the start or the last loss
    for stick in states:
        sent = scaler.step(stick, period_s)
        released = stick is not None and (released or not stick.enable)
        if stick is None or not stick.enable or not released:
            assert sent in (None, Twist2())
            assert not (sent is not None and last is None)  # a zero only after a speed
            last = None
            continue
        assert sent is not None
        before = last or Twist2()
        assert abs(sent.v_m_s - before.v_m_s) <= V_SLEW_M_S2 * period_s + 1e-12
        assert abs(sent.w_rad_s - before.w_rad_s) <= W_SLEW_RAD_S2 * period_s + 1e-12
        last = sent


def test_a_reconnected_gamepad_with_the_button_held_does_not_drive() -> None:
    scaler, held = SpeedScaler(OPTIONS, DRIVE, LIMIT), JoystickState(forward=1.0, enable=True)
    assert scaler.step(held, 0.05) is None  # nor at the start
    assert scaler.step(JoystickState(), 0.05) is None
    assert scaler.step(held, 0.05) is not None
    assert scaler.step(None, 0.05) == Twist2()
    assert scaler.step(None, 0.05) is None
    assert scaler.step(held, 0.05) is None
    scaler.step(JoystickState(), 0.05)
    assert scaler.step(held, 0.05) is not None


def test_full_stick_becomes_full_speed() -> None:
    scaler = SpeedScaler(OPTIONS, DRIVE, LIMIT)
    scaler.step(JoystickState(), 0.05)
    for _ in range(40):
        sent = scaler.step(JoystickState(forward=1.0, enable=True), 0.05)
    assert sent is not None
    assert sent.v_m_s == pytest.approx(OPTIONS.v_max_m_s)
