"""Parameters that describe the robot: geometry, directions, battery, current sensor, PWM frequency."""

import ctypes

import pytest

from tests.firmware.core.host_interface import HostInterface
from thumper.board import messages as m

GAINS = ("kp", "ki", "ks", "kv", "ka", "acceleration", "deceleration", "current_limit")
ROBOT = [spec for spec in m.PARAMETERS if spec.name not in GAINS]
"""Everything but the gains, which may change while the robot drives."""


@pytest.mark.parametrize("off", [m.State.DISARMED, m.State.FAULT])
@pytest.mark.parametrize("armed", [m.State.CLOSED_LOOP, m.State.MANUAL])
@pytest.mark.parametrize("spec", ROBOT, ids=lambda spec: spec.name)
def test_a_parameter_of_the_robot_changes_only_with_the_motors_off(
    core: ctypes.CDLL, spec: m.ParameterSpec, armed: m.State, off: m.State
) -> None:
    """In FAULT too: some faults only end with the right value."""
    host = HostInterface(core)
    value = round(spec.scale * spec.maximum)
    host.command(m.Command.ARM)
    if armed is m.State.MANUAL:
        host.send(m.SetMotorPwm(left=0, right=0))
    assert host.status()[0] is armed
    before = host.get(spec.name)
    assert host.set(spec.name, value) is m.AckStatus.ARMED
    assert host.get(spec.name) == before
    host.command(m.Command.DISARM if off is m.State.DISARMED else m.Command.E_STOP)
    assert host.status()[0] is off
    assert host.set(spec.name, value) is m.AckStatus.OK
    assert host.get(spec.name) == value


@pytest.mark.parametrize("name", GAINS)
def test_a_gain_changes_while_driving(core: ctypes.CDLL, name: str) -> None:
    host = HostInterface(core)
    host.command(m.Command.ARM)
    assert host.set(name, host.get(name)) is m.AckStatus.OK


def test_identity_reports_the_robot(core: ctypes.CDLL) -> None:
    host = HostInterface(core)
    for name, value in (
        ("counts_per_rev", 1920),
        ("wheel_radius", 33),
        ("track", 160),
        ("right_motor_reversed", 1),
        ("left_encoder_reversed", 1),
        ("battery_cells", 3),
        ("battery_stop", 3000),
        ("battery_rearm", 3600),
        ("current_scale", 512),
        ("current_zero", 100),
        ("pwm_frequency", 31_373),
    ):
        assert host.set(name, value) is m.AckStatus.OK
    (identity,) = host.send(m.Identify())
    assert isinstance(identity, m.Identity)
    assert (identity.counts_per_rev, identity.wheel_radius_mm, identity.track_mm) == (1920, 33, 160)
    assert identity.reversed_sides == 0b0110
    assert (identity.battery_cells, identity.pwm_frequency_Hz) == (3, 31_373)
    assert (identity.battery_stop_mV, identity.battery_rearm_mV) == (3000, 3600)
    assert (identity.current_scale, identity.current_zero) == (512, 100)


def test_a_pack_of_three_cells_is_accepted_once_it_is_set(core: ctypes.CDLL) -> None:
    """Before that it reads too high, and the fault must not block the parameter that ends it."""
    host = HostInterface(core, battery_mV=11_400)
    assert host.status()[:2] == (m.State.FAULT, m.Fault.HIGH_BATTERY)
    assert host.command(m.Command.CLEAR_FAULT) is m.AckStatus.BATTERY_HIGH
    assert host.set("battery_cells", 3) is m.AckStatus.OK
    core.host_battery(host.handle, 11_400)
    assert host.command(m.Command.CLEAR_FAULT) is m.AckStatus.OK
    assert host.command(m.Command.ARM) is m.AckStatus.OK
    while not core.host_battery(host.handle, 9500):
        assert host.status()[1] is m.Fault.NONE
    assert host.telemetry().battery_mV < 9600
    assert host.status()[1] is m.Fault.LOW_BATTERY


def test_the_thresholds_are_per_cell(core: ctypes.CDLL) -> None:
    host = HostInterface(core)
    host.set("battery_stop", 3000)
    host.set("battery_rearm", 3100)
    for _ in range(200):
        assert core.host_battery(host.handle, 6010) == 0
    assert host.telemetry().warnings == 1
    while not core.host_battery(host.handle, 5990):
        pass
    assert host.status()[1] is m.Fault.LOW_BATTERY


def test_each_direction_has_its_own_flag(core: ctypes.CDLL) -> None:
    """In the order of the identity's bits."""
    names = [f"{side}_{part}_reversed" for part in ("motor", "encoder") for side in ("left", "right")]
    for bit, name in enumerate(names):
        host = HostInterface(core)
        host.set(name, 1)
        (identity,) = host.send(m.Identify())
        assert isinstance(identity, m.Identity)
        assert identity.reversed_sides == 1 << bit
        assert core.host_reversed(host.handle) == 1 << bit, "as driven and counted"


@pytest.mark.parametrize("first", ["gyroscope", "currents_at_a4"])
def test_gyroscope_and_currents_cannot_both_have_a4_and_a5(core: ctypes.CDLL, first: str) -> None:
    second = "currents_at_a4" if first == "gyroscope" else "gyroscope"
    host = HostInterface(core)
    assert host.set(first, 1) is m.AckStatus.OK
    assert host.set(second, 1) is m.AckStatus.PINS_IN_USE
    assert host.get(second) == 0
    assert host.set(second, 0) is m.AckStatus.OK
    assert host.set(first, 1) is m.AckStatus.OK
    assert host.set("input_1", 1) is m.AckStatus.OK
    assert host.set(first, 0) is m.AckStatus.OK
    assert host.set(second, 1) is m.AckStatus.OK
