"""Test the simulated drive train against closed forms: dynamics, dead band, battery, brake, yaw."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.hil.chip.conftest import BuildAvr
from tests.hil.chip.rig import Rig
from thumper_hil.chip.chip_faults import SideFaults
from thumper_hil.chip.robot_params import RobotParams

RADIUS_M = 0.062


def settled_rad_s(rig: Rig, pwm: int) -> float:
    rig.set(pwm, pwm)
    rig.run_for(1.0)
    return rig.chip.truth().wheel_rad_s[0]


def time_constant_s(params: RobotParams, load_kg_m2: float) -> float:
    """Return the first-order time constant R J / (R B + Kt Kf) of one motor with its share of the load."""
    motor = params.motor
    electric = motor.torque_Nm_A * motor.back_emf_V_s_rad / motor.resistance_Ohm
    return (motor.inertia_kg_m2 + load_kg_m2) / (motor.viscous_Nm_s_rad + electric)


@pytest.mark.parametrize("on_ground", [True, False])
def test_step_response_is_first_order(build_avr: BuildAvr, even_params: RobotParams, on_ground: bool) -> None:
    """A step between two speeds (constant friction, stiff supply) is within 1 % of the closed form."""
    body = even_params.body
    if not on_ground:
        body = replace(body, mass_kg=0.0, yaw_inertia_kg_m2=0.0, friction=0.0)
    battery = replace(even_params.battery, resistance_Ohm=0.0)
    params = replace(even_params, body=body, battery=battery)
    rig = Rig(build_avr("bridge"), params)
    start = settled_rad_s(rig, 80)
    rig.set(200, 200)
    speeds = []
    for _ in range(400):
        rig.run_for(0.001)
        speeds.append(rig.chip.truth().wheel_rad_s[0])
    speed = np.array(speeds)
    end = settled_rad_s(rig, 200)
    rest = (end - speed) / (end - start)
    used = (rest > 0.05) & (rest < 0.8)
    slope = np.polyfit(np.arange(speed.size)[used] * 0.001, np.log(rest[used]), 1)[0]
    expected_s = time_constant_s(params, body.mass_kg * RADIUS_M**2 / 6.0)
    assert -1.0 / slope == pytest.approx(expected_s, rel=0.01)
    assert expected_s == pytest.approx(0.075 if on_ground else 0.027, rel=0.02)


def test_gain_and_friction_match_the_reference_plant(build_avr: BuildAvr, even_params: RobotParams) -> None:
    """0.0584 rad/s per PWM and a 19 PWM offset, both at 7.4 V at the terminals."""
    rig = Rig(build_avr("bridge"), even_params)
    at_7_4_V = []
    for pwm in (60, 120, 180, 240):
        speed = settled_rad_s(rig, pwm)
        at_7_4_V.append((pwm * rig.chip.truth().battery_V / 7.4, speed))
    pwm_7_4, speed_rad_s = np.array(at_7_4_V).T
    gain, offset = np.polyfit(pwm_7_4, speed_rad_s, 1)
    assert gain == pytest.approx(0.0584, rel=0.01)
    assert -offset / gain == pytest.approx(19.3, rel=0.03)
    assert gain * 255.0 + offset == pytest.approx(13.8, rel=0.02)  # free speed at 7.4 V


def test_dead_band(build_avr: BuildAvr, even_params: RobotParams) -> None:
    """The wheels do not turn at all below break-away and turn above it, in both directions."""
    for sign in (1, -1):
        rig = Rig(build_avr("bridge"), even_params)
        rig.set(sign * 19, sign * 19)
        rig.run_for(0.5)
        assert rig.chip.truth().wheel_rad == (0.0, 0.0)
        rig.set(sign * 23, sign * 23)
        rig.run_for(0.5)
        assert sign * rig.chip.truth().wheel_rad[1] > 0.01


def test_battery_voltage_sags_and_charge_decreases(build_avr: BuildAvr, even_params: RobotParams) -> None:
    """Terminal voltage is the open-circuit voltage minus R I; charge follows the integral of the current."""
    battery = replace(even_params.battery, capacity_Ah=0.01)
    rig = Rig(build_avr("bridge"), replace(even_params, battery=battery))
    rest = rig.chip.truth()
    assert rest.battery_V == pytest.approx(7.68 - 0.015 * 0.06, abs=2e-3)
    settled_rad_s(rig, 255)
    before = rig.chip.truth()
    rig.run_for(1.0)
    after = rig.chip.truth()
    current_A = sum(after.current_A) + battery.idle_current_A
    table = np.linspace(0.0, 1.0, 11)
    open_circuit_V = np.interp(after.charge, table, battery.open_circuit_V)
    assert after.battery_V == pytest.approx(open_circuit_V - 0.015 * current_A, abs=2e-3)
    assert before.charge - after.charge == pytest.approx(current_A / 3600.0 / battery.capacity_Ah, rel=0.05)


@pytest.mark.parametrize("pwm", [50, 100, 200])
def test_short_circuit_power_comes_from_the_battery(
    build_avr: BuildAvr, even_params: RobotParams, pwm: int
) -> None:
    """The power is V^2 / R times the duty: a short circuit has no inductance that sustains the current."""
    rig = Rig(
        build_avr("bridge"), replace(even_params, battery=replace(even_params.battery, idle_current_A=0.0))
    )
    rig.chip.set_side_faults(0, SideFaults(connected=0.0, shorted=True))
    rig.set(pwm, 0)
    rig.run_for(0.1)
    truth = rig.chip.truth()
    drawn_A = (7.68 - truth.battery_V) / even_params.battery.resistance_Ohm
    assert drawn_A * truth.battery_V == pytest.approx(pwm / 255 * truth.battery_V**2 / 0.1, rel=0.01)
    assert truth.current_A[0] == pytest.approx(drawn_A, rel=0.01)


def test_brake_pin(build_avr: BuildAvr, even_params: RobotParams) -> None:
    """Full brake stops like a shorted motor; brake at PWM 0 lets the wheels coast on friction alone."""
    speeds = {}
    for strength in (0, 255):
        rig = Rig(build_avr("bridge"), even_params)
        settled_rad_s(rig, 200)
        rig.set(strength, strength, brake=True)
        rig.run_for(0.1)
        speeds[strength] = rig.chip.truth().wheel_rad_s[0]
    assert speeds[255] < 0.35 * 11.0
    assert speeds[0] > 0.75 * 11.0


def test_straight_and_turning_motion(build_avr: BuildAvr, even_params: RobotParams) -> None:
    """Forward motion is r w along x; rotation is r (wr - wl) / effective track, positive to the left."""
    rig = Rig(build_avr("bridge"), even_params)
    rig.set(100, 100)
    rig.run_for(1.0)
    truth = rig.chip.truth()
    assert truth.map_from_base.x_m == pytest.approx(RADIUS_M * truth.wheel_rad[0], rel=1e-6)
    assert truth.map_from_base.y_m == pytest.approx(0.0, abs=1e-9)
    rig = Rig(build_avr("bridge"), even_params)
    rig.set(-150, 150)  # enough to slide all tyres
    rig.run_for(0.6)
    truth = rig.chip.truth()
    turned = RADIUS_M * (truth.wheel_rad[1] - truth.wheel_rad[0]) / even_params.body.track_m
    assert turned > 0.5
    assert truth.map_from_base.theta_rad == pytest.approx(turned, rel=1e-6)
    assert math.hypot(truth.map_from_base.x_m, truth.map_from_base.y_m) < 1e-3


def test_slip_grows_with_the_yaw_rate(build_avr: BuildAvr, even_params: RobotParams) -> None:
    """In a steady turn the effective track is track (1 + growth yaw), with the yaw rate without growth."""
    params = replace(even_params, body=replace(even_params.body, track_growth_s=0.1))
    for pwm in (70, 110):
        rig = Rig(build_avr("bridge"), params)
        rig.set(-pwm, pwm)
        rig.run_for(1.0)
        start = rig.chip.truth()
        rig.run_for(0.2)
        end = rig.chip.truth()
        apart_rad = np.diff(np.subtract(end.wheel_rad, start.wheel_rad))[0]
        slow_rad = RADIUS_M * apart_rad / params.body.track_m
        turned_rad = (end.map_from_base.theta_rad - start.map_from_base.theta_rad) % math.tau
        assert turned_rad == pytest.approx(slow_rad / (1.0 + 0.1 * slow_rad / 0.2), rel=2e-3)


def test_robots_differ_by_their_spread_parameters(build_avr: BuildAvr, even_params: RobotParams) -> None:
    """Over 12 seeds, the tracks vary by the configured 2 % and the motor currents vary, too."""
    motor = replace(even_params.motor, unit_spread_ratio=0.03)
    params = replace(even_params, motor=motor, body=replace(even_params.body, track_spread_ratio=0.02))
    tracks_m, currents_A = [], []
    for seed in range(12):
        rig = Rig(build_avr("bridge"), params, seed)
        rig.set(-90, 90)
        rig.run_for(0.6)
        truth = rig.chip.truth()
        tracks_m.append(RADIUS_M * (truth.wheel_rad[1] - truth.wheel_rad[0]) / truth.map_from_base.theta_rad)
        currents_A.append(truth.current_A[1])
    assert np.std(tracks_m) / 0.3675 == pytest.approx(0.02, abs=0.01)
    assert np.mean(tracks_m) == pytest.approx(0.3675, rel=0.02)
    assert 0.005 < np.std(currents_A) / np.mean(currents_A) < 0.1


def test_energy_balances(build_avr: BuildAvr, even_params: RobotParams) -> None:
    """In straight acceleration the motors' mechanical energy equals friction, drag and kinetic energy."""
    rig = Rig(build_avr("bridge"), even_params)
    motor, body = even_params.motor, even_params.body
    rig.set(160, 160)
    supplied_J, step_s = 0.0, 0.0005
    before = rig.chip.truth()
    for _ in range(600):
        rig.run_for(step_s)
        after = rig.chip.truth()
        for side in (0, 1):
            speed = 0.5 * (before.wheel_rad_s[side] + after.wheel_rad_s[side])
            current = 0.5 * (before.current_A[side] + after.current_A[side])
            supplied_J += motor.torque_Nm_A * current * speed * step_s
            supplied_J -= 3.0 * (motor.viscous_Nm_s_rad * speed + motor.coulomb_Nm) * speed * step_s
        before = after
    speed = after.wheel_rad_s[0]
    kinetic_J = 0.5 * body.mass_kg * (RADIUS_M * speed) ** 2 + 6 * 0.5 * motor.inertia_kg_m2 * speed**2
    assert kinetic_J > 0.9
    assert supplied_J == pytest.approx(kinetic_J, rel=0.03)


def test_blocked_motors_draw_the_stall_current(build_avr: BuildAvr, even_params: RobotParams) -> None:
    """Blocked by an obstacle, each side draws n V duty / R and the body does not move."""
    rig = Rig(build_avr("bridge"), even_params)
    rig.chip.hold(1.0, 0.0)
    rig.set(40, 40)
    rig.run_for(0.5)
    truth = rig.chip.truth()
    expected_A = 3.0 * truth.battery_V * 40 / 255 / even_params.motor.resistance_Ohm
    assert truth.current_A[0] == pytest.approx(expected_A, rel=0.01)
    assert truth.wheel_rad_s == (0.0, 0.0)
    rig.set(200, 200)  # strong enough to spin the wheels on the spot
    rig.run_for(0.5)
    truth = rig.chip.truth()
    assert truth.wheel_rad_s[0] > 3.0
    assert truth.map_from_base.x_m == 0.0
    rig.set(-60, -60)  # motion away from the obstacle is free
    rig.run_for(1.0)
    assert rig.chip.truth().map_from_base.x_m < -0.05


@settings(max_examples=15, deadline=None)
@given(
    commands=st.lists(st.tuples(st.integers(-255, 255), st.integers(-255, 255)), min_size=1, max_size=6),
    seed=st.integers(0, 2**32),
)
def test_every_encoder_edge_is_counted(
    build_avr: BuildAvr, commands: list[tuple[int, int]], seed: int
) -> None:
    """For any commands the firmware counts the true travel while it writes to the encoder ports."""
    rig = Rig(build_avr("bridge"), RobotParams.load(), seed)
    for left, right in commands:
        rig.set(left, right)
        rig.run_for(0.15)
    rig.set(255, 255, brake=True)
    rig.run_for(1.0)
    counts = rig.set(255, 255, brake=True)  # keeps the stationary wheels braked
    truth = rig.chip.truth()
    assert counts.lost == 0
    assert [counts.left, counts.right] == [count % 2**16 for count in truth.encoder_count]
    for count, travel_rad in zip(truth.encoder_count, truth.wheel_rad, strict=True):
        assert count == pytest.approx(travel_rad * 1200 / math.tau, abs=1.01)


def test_pwm_takes_effect_at_timer_top(build_avr: BuildAvr, even_params: RobotParams) -> None:
    """Phase-correct PWM is double-buffered: a new duty takes effect mid-period, after 8.2 ms at most."""
    delays_s = []
    for wait_s in (0.001, 0.003, 0.005, 0.007):
        rig = Rig(build_avr("bridge"), even_params)
        rig.run_for(wait_s)
        rig.set(255, 255)
        start = rig.chip.truth().time_s
        while rig.chip.truth().wheel_rad_s[0] == 0.0:
            rig.run_for(0.0005)
        delays_s.append(rig.chip.truth().time_s - start)
    assert max(delays_s) < 0.0082 + 0.002
    assert max(delays_s) - min(delays_s) > 0.003
