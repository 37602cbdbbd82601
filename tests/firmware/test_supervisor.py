"""Every state with every event: the host's requests and each fault."""

import ctypes
import itertools

import pytest

from thumper.link.messages import AckStatus, Fault, State

DISARM, ARM, E_STOP, CLEAR, MANUAL = REQUESTS = range(5)
FAULTS = [fault for fault in Fault if fault is not Fault.NONE]
WAYS_IN = {
    State.DISARMED: [],
    State.CLOSED_LOOP: [ARM],
    State.MANUAL: [ARM, MANUAL],
    State.FAULT: [ARM, Fault.LINK_LOST],
}
# The whole machine, written as the safety argument reads: next state where it is not the same.
NEXT = {
    State.DISARMED: {ARM: State.CLOSED_LOOP, E_STOP: State.FAULT},
    State.CLOSED_LOOP: {DISARM: State.DISARMED, MANUAL: State.MANUAL, E_STOP: State.FAULT},
    State.MANUAL: {DISARM: State.DISARMED, ARM: State.CLOSED_LOOP, E_STOP: State.FAULT},
    State.FAULT: {CLEAR: State.DISARMED},
}
AT_REST_TOO = {Fault.LOW_BATTERY, Fault.E_STOP, Fault.WATCHDOG, Fault.BAD_PARAMETERS}
OVER_ALL_OTHERS = {Fault.LOW_BATTERY, Fault.E_STOP}


def feed(core: ctypes.CDLL, machine: int, event: int) -> None:
    if isinstance(event, Fault):
        core.supervisor_trip(machine, event)
    else:
        core.supervisor_handle(machine, event, 0)


def machine_in(core: ctypes.CDLL, state: State) -> int:
    machine: int = core.supervisor_new()
    for event in WAYS_IN[state]:
        feed(core, machine, event)
    assert core.supervisor_state(machine) == state
    return machine


@pytest.mark.parametrize(("state", "request_"), list(itertools.product(State, REQUESTS)))
def test_every_request(core: ctypes.CDLL, state: State, request_: int) -> None:
    machine = machine_in(core, state)
    status = core.supervisor_handle(machine, request_, 0)
    after = NEXT[state].get(request_, state)
    refused = state is State.FAULT and request_ in (ARM, MANUAL)
    assert core.supervisor_state(machine) == after
    assert status == (AckStatus.FAULT_LATCHED if refused else AckStatus.OK)
    if after is State.FAULT:
        assert core.supervisor_fault(machine) == (Fault.E_STOP if request_ == E_STOP else Fault.LINK_LOST)
    else:
        assert core.supervisor_fault(machine) == Fault.NONE


@pytest.mark.parametrize(("state", "fault"), list(itertools.product(State, FAULTS)))
def test_every_fault(core: ctypes.CDLL, state: State, fault: Fault) -> None:
    machine = machine_in(core, state)
    core.supervisor_trip(machine, fault)
    if state is State.DISARMED and fault not in AT_REST_TOO:
        assert core.supervisor_state(machine) == State.DISARMED
        assert core.supervisor_fault(machine) == Fault.NONE
        return
    assert core.supervisor_state(machine) == State.FAULT
    kept = state is State.FAULT and fault not in OVER_ALL_OTHERS
    assert core.supervisor_fault(machine) == (Fault.LINK_LOST if kept else fault)
    core.supervisor_handle(machine, CLEAR, 0)
    assert core.supervisor_state(machine) == State.DISARMED
    assert core.supervisor_fault(machine) == Fault.NONE


@pytest.mark.parametrize("state", list(State))
@pytest.mark.parametrize("request_", [ARM, CLEAR])
def test_a_low_battery_refuses_to_arm_or_clear(core: ctypes.CDLL, state: State, request_: int) -> None:
    machine = machine_in(core, state)
    assert core.supervisor_handle(machine, request_, 1) == AckStatus.BATTERY_LOW
    assert core.supervisor_state(machine) == state


@pytest.mark.parametrize("state", list(State))
@pytest.mark.parametrize("request_", [DISARM, E_STOP])
def test_a_low_battery_refuses_no_stop(core: ctypes.CDLL, state: State, request_: int) -> None:
    machine = machine_in(core, state)
    assert core.supervisor_handle(machine, request_, 1) == AckStatus.OK
    assert core.supervisor_state(machine) in (State.DISARMED, State.FAULT)
