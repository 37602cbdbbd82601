"""Every instruction of the main loop, with an interrupt forced right after it. On demand, a few minutes:

python -m tests.firmware.preemption.whole_loop                 each instruction once in each phase
python -m tests.firmware.preemption.whole_loop --visits 4      four times: in other states of the loop
python -m tests.firmware.preemption.whole_loop --only TICK     one interrupt

The phases together pass through all that the main loop does: telemetry, every request, battery readings, a
save, a reversal, a set of constants, gyroscope and accelerometer. What counts is that nothing crashes,
telemetry holds the samples of one tick, each tick obeys a command that was sent, a request is answered and
each edge is counted.
"""

import argparse
import os
import sys
from collections.abc import Iterator
from pathlib import Path

from tests.firmware.board.boot import ELF
from tests.firmware.board.wire import run_for, send
from tests.firmware.preemption.scenarios import frames_of, uncounted
from thumper.board.messages import (
    PARAMETERS,
    Command,
    CommandRequest,
    GetParameter,
    Identify,
    Identity,
    Message,
    SetMotorPwm,
    SetParameter,
    SetWheelSpeeds,
    State,
    Telemetry,
)
from thumper_hil.chip.preemption import Branch, Interrupt, SweptChip, symbol
from thumper_hil.chip.robot_params import RobotParams

INDEX = {spec.name: spec.index for spec in PARAMETERS}
SPEEDS, OTHER, PWM = (0x0102, 0x0304), (-0x0506, -0x0708), (100, -100)
WINDOW_S = 0.11  # more than a control tick and a battery reading
TAIL_S = 4.5e-3
TICK_S = 0.1

REQUESTS: dict[str, tuple[Message, ...]] = {
    "driving": (SetWheelSpeeds(left=OTHER[0], right=OTHER[1]),),
    "reversal": (SetMotorPwm(left=PWM[0], right=PWM[1]),),
    "questions": (Identify(), GetParameter(index=3), GetParameter(index=99), CommandRequest(command=99)),  # type: ignore[arg-type]
    "parameters": (SetParameter(index=0, value=900), SetParameter(index=0, value=-1)),
    "save": (CommandRequest(command=Command.SAVE),),
    "disarm": (CommandRequest(command=Command.DISARM),),
    "stop": (CommandRequest(command=Command.E_STOP), CommandRequest(command=Command.CLEAR_FAULT)),
    "load": (CommandRequest(command=Command.LOAD), CommandRequest(command=Command.RESTORE_DEFAULTS)),
}
"""What the host sends at the start of each phase."""


def entry(state: State, pair: tuple[int, int]) -> bytes:
    """Return a command as the control tick finds it."""
    return bytes((state,)) + b"".join(value.to_bytes(2, "little", signed=True) for value in pair)


COMMANDS = {
    *(entry(State.CLOSED_LOOP, pair) for pair in (SPEEDS, OTHER, (0, 0))),
    *(entry(State.MANUAL, pair) for pair in (PWM, (0, 0))),
    entry(State.DISARMED, (0, 0)),
    entry(State.FAULT, (0, 0)),
}


def robot(elf: Path, *, drives: bool) -> SweptChip:
    """Return a robot with a gyroscope; or a bare one at rest, whose wheels give no edge."""
    chip = SweptChip(elf, params=RobotParams.load(), seed=1)
    chip.fit_gyroscope()
    run_for(chip, 0.305)
    if not drives:
        return chip
    for sensor in ("gyroscope", "tilt_limit"):
        send(chip, SetParameter(index=INDEX[sensor], value=1))
    send(chip, CommandRequest(command=Command.ARM))
    for _ in range(4):
        send(chip, SetWheelSpeeds(left=SPEEDS[0], right=SPEEDS[1]))
        run_for(chip, 0.09)
    return chip


def failures_of(branch: Branch, interrupt: Interrupt) -> Iterator[str]:
    """Yield what went wrong in a branch of a driving robot."""
    if branch.crashed:
        yield "crashed"
        return
    frames = frames_of(branch)
    told = [frame.payload for frame in frames if frame.message_id == Telemetry.ID]
    if any(payload[: len(branch.exits[0])] not in branch.exits for payload in told):
        yield "telemetry mixes two ticks"
    if any(found not in COMMANDS for found in branch.entries[1:]):  # the first one is from before the branch
        yield "a tick obeys a command that nobody sent"
    if interrupt is Interrupt.TICK and not told:
        yield "no telemetry"
    if interrupt is Interrupt.RECEIVE and not any(frame.message_id == Identity.ID for frame in frames):
        yield "a request was lost"


def sweep(elf: Path, phase: str, interrupt: Interrupt, visits: int) -> tuple[set[int], list[str]]:
    """Return the addresses that were swept in one phase, and the failures."""
    edge = interrupt in (Interrupt.LEFT_EDGE, Interrupt.RIGHT_EDGE)
    chip = robot(elf, drives=not edge)
    chip.receive(chip.available)
    for request in REQUESTS[phase]:
        send(chip, request)
    branches = chip.sweep(
        interrupt,
        seconds=WINDOW_S,
        tail_s=TICK_S + TAIL_S if edge else TAIL_S,
        watch=(symbol(elf, "command"), symbol(elf, "samples")),
        per_address=visits,
    )
    failures = [
        f"{phase}, {branch.address:#06x}: {text}"
        for branch in branches
        for text in (uncounted(branch, interrupt) if edge else failures_of(branch, interrupt))
    ]
    return {branch.address for branch in branches}, failures


def spent_s() -> float:
    """Return the processor time of this process and of all branches."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


def main() -> int:
    """Sweep; print how many instructions were reached and what failed; return 1 if anything did."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--visits", type=int, default=1, help="how often at each address, in each phase")
    parser.add_argument("--only", nargs="+", default=[i.name for i in Interrupt], help="interrupts")
    parser.add_argument("--phases", nargs="+", choices=REQUESTS, default=list(REQUESTS))
    arguments = parser.parse_args()
    failed = False
    for name in arguments.only:
        interrupt, start_s = Interrupt[name], spent_s()
        reached: set[int] = set()
        failures: list[str] = []
        for phase in arguments.phases:
            # The motors are off in the edge sweep: phases that drive would turn the wheels.
            if interrupt in (Interrupt.LEFT_EDGE, Interrupt.RIGHT_EDGE) and phase == "reversal":
                continue
            addresses, found = sweep(ELF, phase, interrupt, arguments.visits)
            reached |= addresses
            failures += found
        failed = failed or bool(failures)
        seconds = spent_s() - start_s
        print(f"{name}: {len(reached)} instructions, {len(failures)} failures, {seconds:.0f} s", flush=True)
        print(*failures[:8], sep="\n", end="\n" if failures else "", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
