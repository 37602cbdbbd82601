"""Every state with every event."""

import ctypes
import itertools

import pytest

from thumper.link.messages import AckStatus, Fault, State

DISARM, ARM, E_STOP, CLEAR, MANUAL, LINK_LOST, BATTERY_LOW = EVENTS = range(7)
WAYS_IN = {
    State.DISARMED: [],
    State.CLOSED_LOOP: [ARM],
    State.MANUAL: [ARM, MANUAL],
    State.FAULT: [ARM, LINK_LOST],
}
# The whole machine, written as the safety argument reads: next state, and the answer when it is not OK.
NEXT = {
    State.DISARMED: {ARM: State.CLOSED_LOOP, E_STOP: State.FAULT, BATTERY_LOW: State.FAULT},
    State.CLOSED_LOOP: {
        DISARM: State.DISARMED,
        MANUAL: State.MANUAL,
        E_STOP: State.FAULT,
        LINK_LOST: State.FAULT,
        BATTERY_LOW: State.FAULT,
    },
    State.MANUAL: {
        DISARM: State.DISARMED,
        ARM: State.CLOSED_LOOP,
        E_STOP: State.FAULT,
        LINK_LOST: State.FAULT,
        BATTERY_LOW: State.FAULT,
    },
    State.FAULT: {CLEAR: State.DISARMED},
}
FAULT_OF = {E_STOP: Fault.E_STOP, BATTERY_LOW: Fault.LOW_BATTERY, LINK_LOST: Fault.LINK_LOST}


def machine_in(core: ctypes.CDLL, state: State) -> int:
    machine: int = core.supervisor_new()
    for event in WAYS_IN[state]:
        core.supervisor_handle(machine, event, 0)
    assert core.supervisor_state(machine) == state
    return machine


@pytest.mark.parametrize(("state", "event"), list(itertools.product(State, EVENTS)))
def test_every_transition(core: ctypes.CDLL, state: State, event: int) -> None:
    machine = machine_in(core, state)
    status = core.supervisor_handle(machine, event, 0)
    after = NEXT[state].get(event, state)
    refused = state is State.FAULT and event in (ARM, MANUAL)
    assert core.supervisor_state(machine) == after
    assert status == (AckStatus.FAULT_LATCHED if refused else AckStatus.OK)
    if after is State.FAULT:
        assert core.supervisor_fault(machine) == FAULT_OF.get(event, Fault.LINK_LOST)
    else:
        assert core.supervisor_fault(machine) == Fault.NONE


@pytest.mark.parametrize("state", list(State))
@pytest.mark.parametrize("event", [ARM, CLEAR])
def test_a_low_battery_refuses_to_arm_or_clear(core: ctypes.CDLL, state: State, event: int) -> None:
    machine = machine_in(core, state)
    assert core.supervisor_handle(machine, event, 1) == AckStatus.BATTERY_LOW
    assert core.supervisor_state(machine) == state


def test_a_later_link_loss_does_not_hide_the_first_fault(core: ctypes.CDLL) -> None:
    machine = machine_in(core, State.CLOSED_LOOP)
    core.supervisor_handle(machine, E_STOP, 0)
    core.supervisor_handle(machine, LINK_LOST, 0)
    assert core.supervisor_fault(machine) == Fault.E_STOP
