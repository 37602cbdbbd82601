"""The protecting inputs: debounced, active low or high, and no arming while one is active."""

import ctypes
import itertools

import pytest

from tests.firmware.core.host_interface import HostInterface
from thumper.board import messages as m

OFF, WHILE_LOW, WHILE_HIGH = range(3)
CALLS = 4
BOTH_HIGH = 0b11


def levels(number: int, *, high: bool) -> int:
    """Return the levels with this one at input `number` and the opposite at the other."""
    return number if high else number ^ BOTH_HIGH


@pytest.mark.parametrize("mode", [OFF, WHILE_LOW, WHILE_HIGH])
@pytest.mark.parametrize("number", [1, 2])
def test_every_sequence_of_ten_levels(core: ctypes.CDLL, number: int, mode: int) -> None:
    """The motors stop after four active levels in a row, never before, and by the right name."""
    for sequence in itertools.product((False, True), repeat=10):
        host = HostInterface(core)
        host.set(f"input_{number}", mode)
        in_a_row, expected = 0, m.Fault.NONE
        for high in sequence:
            core.host_inputs(host.handle, levels(number, high=high))
            in_a_row = in_a_row + 1 if mode == (WHILE_HIGH if high else WHILE_LOW) else 0
            if in_a_row == CALLS:
                expected = m.Fault[f"INPUT_{number}"]
            assert host.status()[1] is expected


@pytest.mark.parametrize("state", [m.State.DISARMED, m.State.CLOSED_LOOP, m.State.MANUAL])
def test_an_input_stops_the_motors_in_every_state(core: ctypes.CDLL, state: m.State) -> None:
    host = HostInterface(core)
    host.set("input_2", WHILE_LOW)
    if state is not m.State.DISARMED:
        host.command(m.Command.ARM)
    if state is m.State.MANUAL:
        host.send(m.SetMotorPwm(left=100, right=100))
    assert host.status()[0] is state
    for _ in range(CALLS):
        core.host_inputs(host.handle, 0b01)
    assert host.status() == (m.State.FAULT, m.Fault.INPUT_2, 0, 0)


@pytest.mark.parametrize("number", [1, 2])
def test_nothing_arms_or_clears_while_an_input_is_active(core: ctypes.CDLL, number: int) -> None:
    host = HostInterface(core)
    host.set(f"input_{number}", WHILE_HIGH)
    for _ in range(300):
        core.host_inputs(host.handle, levels(number, high=True))
    assert host.command(m.Command.CLEAR_FAULT) is m.AckStatus.INPUT_ACTIVE
    assert host.command(m.Command.ARM) is m.AckStatus.INPUT_ACTIVE
    core.host_inputs(host.handle, levels(number, high=False))
    assert host.status()[1] is m.Fault[f"INPUT_{number}"], "latched"
    assert host.command(m.Command.CLEAR_FAULT) is m.AckStatus.OK
    assert host.command(m.Command.ARM) is m.AckStatus.OK
    assert host.status()[1] is m.Fault.NONE


def test_a_switch_of_the_other_level_can_be_set_right_in_its_fault(core: ctypes.CDLL) -> None:
    """Nothing else would end the fault: the input stays active."""
    host = HostInterface(core)
    host.set("input_1", WHILE_LOW)
    for _ in range(CALLS):
        core.host_inputs(host.handle, 0)
    assert host.command(m.Command.CLEAR_FAULT) is m.AckStatus.INPUT_ACTIVE
    assert host.set("input_1", WHILE_HIGH) is m.AckStatus.OK
    core.host_inputs(host.handle, 0)
    assert host.command(m.Command.CLEAR_FAULT) is m.AckStatus.OK


def test_an_unknown_battery_is_told_first(core: ctypes.CDLL) -> None:
    """The host waits for the battery by itself, so it must see that reason."""
    host = HostInterface(core, battery_mV=0)
    host.set("input_1", WHILE_LOW)
    for _ in range(CALLS):
        core.host_inputs(host.handle, 0)
    assert host.command(m.Command.CLEAR_FAULT) is m.AckStatus.BATTERY_UNKNOWN


def test_inputs_change_nothing_else(core: ctypes.CDLL) -> None:
    host = HostInterface(core)
    for number in (1, 2):
        host.set(f"input_{number}", WHILE_HIGH)
    before = host.telemetry()
    for _ in range(CALLS - 1):
        core.host_inputs(host.handle, BOTH_HIGH)
    assert host.telemetry() == before
