"""Every state with every event: the host's requests and each fault."""

import ctypes
import itertools
import re
import subprocess
from pathlib import Path

import pytest

from tests.firmware.conftest import FIRMWARE
from thumper.board.messages import AckStatus, Fault, State

DISARM, ARM, E_STOP, CLEAR, MANUAL = REQUESTS = range(5)
FAULTS = [fault for fault in Fault if fault is not Fault.NONE]
WAYS_IN = {
    State.DISARMED: [],
    State.CLOSED_LOOP: [ARM],
    State.MANUAL: [ARM, MANUAL],
    State.FAULT: [ARM, Fault.LINK_LOST],
}
# The complete state machine, written like the safety argument: the next state where it changes.
NEXT = {
    State.DISARMED: {ARM: State.CLOSED_LOOP, E_STOP: State.FAULT},
    State.CLOSED_LOOP: {DISARM: State.DISARMED, MANUAL: State.MANUAL, E_STOP: State.FAULT},
    State.MANUAL: {DISARM: State.DISARMED, ARM: State.CLOSED_LOOP, E_STOP: State.FAULT},
    State.FAULT: {CLEAR: State.DISARMED},
}
AT_REST_TOO = {Fault.LOW_BATTERY, Fault.E_STOP, Fault.WATCHDOG, Fault.BAD_PARAMETERS}
AT_REST_TOO |= {Fault.ADC_STOPPED, Fault.HIGH_BATTERY, Fault.INPUT_1, Fault.INPUT_2}
DRAWING = Path(__file__).resolve().parents[3] / "docs/images/board_states.svg"
NOT_READY = [AckStatus.BATTERY_LOW, AckStatus.BATTERY_UNKNOWN, AckStatus.BATTERY_HIGH, AckStatus.INPUT_ACTIVE]


def survivor(latched: Fault, fault: Fault) -> Fault:
    """Return the fault that stays: the first, but E_STOP outranks all, and LOW_BATTERY all others."""
    if Fault.E_STOP in (latched, fault):
        return Fault.E_STOP
    return fault if latched is Fault.NONE or fault is Fault.LOW_BATTERY else latched


def feed(core: ctypes.CDLL, machine: int, event: int) -> None:
    if isinstance(event, Fault):
        core.supervisor_trip(machine, event)
    else:
        core.supervisor_handle(machine, event, 0)


def with_cell(row: str, column: int, reaction: str) -> str:
    """Return the row with another reaction in one cell."""
    cells = row.split("{")[1].split("}", maxsplit=1)[0].split(", ")
    cells[column] = reaction
    return f"{{{', '.join(cells)}}},"


def machine_in(core: ctypes.CDLL, state: State) -> int:
    machine: int = core.supervisor_new()
    for event in WAYS_IN[state]:
        feed(core, machine, event)
    assert core.supervisor_state(machine) == state
    return machine


def test_drawing_shows_every_change_of_state_by_a_request() -> None:
    arrows = re.findall(r'data-from="(.+?)" data-request="(.+?)" data-to="(.+?)"', DRAWING.read_text("utf-8"))
    drawn = {(state, request, to) for states, request, to in arrows for state in states.split()}
    names = ["DISARM", "ARM", "E_STOP", "CLEAR_FAULT", "set_motor_pwm"]
    changes = {
        (state.name, names[event], to.name) for state, row in NEXT.items() for event, to in row.items()
    }
    assert drawn == changes


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
    latched = Fault.LINK_LOST if state is State.FAULT else Fault.NONE
    assert core.supervisor_fault(machine) == survivor(latched, fault)
    core.supervisor_handle(machine, CLEAR, 0)
    assert core.supervisor_state(machine) == State.DISARMED
    assert core.supervisor_fault(machine) == Fault.NONE


@pytest.mark.parametrize("number", [Fault.NONE, 200])
def test_an_unknown_fault_also_stops(core: ctypes.CDLL, number: int) -> None:
    machine = machine_in(core, State.CLOSED_LOOP)
    core.supervisor_trip(machine, number)
    assert core.supervisor_state(machine) == State.FAULT


@pytest.mark.parametrize(("latched", "fault"), list(itertools.product(FAULTS, FAULTS)))
def test_the_most_severe_fault_stays(core: ctypes.CDLL, latched: Fault, fault: Fault) -> None:
    machine = machine_in(core, State.CLOSED_LOOP)
    core.supervisor_trip(machine, latched)
    core.supervisor_trip(machine, fault)
    assert core.supervisor_state(machine) == State.FAULT
    assert core.supervisor_fault(machine) == survivor(latched, fault)


@pytest.mark.parametrize("fault", list(Fault))
def test_a_fault_from_before_a_restart_is_latched_again(core: ctypes.CDLL, fault: Fault) -> None:
    """Including those that never trip while disarmed."""
    machine = core.supervisor_new()
    core.supervisor_relatch(machine, fault)
    assert core.supervisor_state(machine) == (State.DISARMED if fault is Fault.NONE else State.FAULT)
    assert core.supervisor_fault(machine) == fault


@pytest.mark.parametrize("state", list(State))
@pytest.mark.parametrize("request_", [ARM, CLEAR])
@pytest.mark.parametrize("battery", NOT_READY)
def test_arm_and_clear_are_refused_until_the_battery_is_ready(
    core: ctypes.CDLL, state: State, request_: int, battery: AckStatus
) -> None:
    machine = machine_in(core, state)
    assert core.supervisor_handle(machine, request_, battery) == battery
    assert core.supervisor_state(machine) == state


@pytest.mark.parametrize("state", list(State))
@pytest.mark.parametrize("request_", [DISARM, E_STOP])
@pytest.mark.parametrize("battery", NOT_READY)
def test_a_stop_works_in_every_battery_state(
    core: ctypes.CDLL, state: State, request_: int, battery: AckStatus
) -> None:
    machine = machine_in(core, state)
    assert core.supervisor_handle(machine, request_, battery) == AckStatus.OK
    assert core.supervisor_state(machine) in (State.DISARMED, State.FAULT)


TABLE = FIRMWARE / "core" / "supervisor.hpp"
MESSAGES = FIRMWARE / "core" / "messages.hpp"
ROWS = TABLE.read_text(encoding="utf-8").split("// disarm, arm,")[1].splitlines()[1:5]
CORRUPTED = {
    "an event without a column": (
        TABLE,
        "kFaultAlways, kEnd",
        "kFaultAlways, kNew, kEnd",
        "needs a reaction",
    ),
    "a state without a row": (MESSAGES, "kStateCount = 4", "kStateCount = 5", "needs a reaction"),
    "a fault without an event": (
        MESSAGES,
        "kBadParameters = 11,",
        "kBadParameters = 11, kNew = 200,",
        "switch",
    ),
    "commands in a different order": (MESSAGES, "kArm = 1,", "kArm = 7,", "same order"),
    "an unreachable state": (
        TABLE,
        "kManu = Reaction::kManual",
        "kManu = Reaction::kClosedLoop",
        "reachable",
    ),
    "an emergency stop ignored": (TABLE, ROWS[1], ROWS[1].replace("kFail", "kLoop", 1), "must stop"),
    "a fault while armed ignored": (
        TABLE,
        ROWS[2],
        ROWS[2][::-1].replace("liaFk", "unaMk", 2)[::-1],
        "must stop",
    ),
    "a fault that unlatches itself": (TABLE, ROWS[3], ROWS[3].replace("kFail", "kOff", 1), "may unlatch"),
    **{
        f"no cell {column} in row {row}": (
            TABLE,
            ROWS[row],
            with_cell(ROWS[row], column, "Reaction::kUnhandled"),
            "needs a reaction",
        )
        for row in range(4)
        for column in range(7)
    },
    **{
        f"a stop (column {column}) ignored in row {row}": (
            TABLE,
            ROWS[row],
            with_cell(ROWS[row], column, "kOff"),
            "must stop",
        )
        for row, column in [(0, 2), (0, 6), (1, 2), (1, 5), (1, 6), (2, 2), (2, 5), (2, 6)]
    },
    **{
        f"a fault left by event {column}": (
            TABLE,
            ROWS[3],
            with_cell(ROWS[3], column, "kOff"),
            "may unlatch",
        )
        for column in (0, 1, 4)
    },
    "a fault never left": (TABLE, ROWS[3], with_cell(ROWS[3], 3, "kFail"), "static assertion"),
    "a refusal outside FAULT": (TABLE, ROWS[1], with_cell(ROWS[1], 4, "kHeld"), "needs a reaction"),
}


@pytest.mark.parametrize("change", CORRUPTED)
def test_a_spoilt_table_does_not_compile(change: str, tmp_path: Path) -> None:
    """The compiler checks the promises of the table: it rejects each change for the right reason."""
    path, old, new, expected = CORRUPTED[change]
    folder = tmp_path / "core"
    folder.mkdir()
    for source in (TABLE, MESSAGES):
        text = source.read_text(encoding="utf-8")
        if source == path:
            assert text.count(old) == 1
            text = text.replace(old, new)
        (folder / source.name).write_text(text, encoding="utf-8")
    (tmp_path / "table.cpp").write_text('#include "core/supervisor.hpp"\n', encoding="utf-8")
    result = subprocess.run(
        [
            "g++",
            "-std=c++14",
            "-Wall",
            "-Werror",
            "-fsyntax-only",
            f"-I{tmp_path}",
            f"-I{TABLE.parents[1]}",
            str(tmp_path / "table.cpp"),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode != 0
    assert expected in result.stderr
