"""Every instruction of the main loop, with an interrupt forced right after it. On demand:

python -m tests.firmware.preemption.whole_loop                 each instruction once in each phase
python -m tests.firmware.preemption.whole_loop --visits 4      four times: in other states of the loop
python -m tests.firmware.preemption.whole_loop --only TICK     one interrupt

The phases together pass through all that the main loop does: telemetry, every request, battery readings, a
save, a reversal, a set of constants, gyroscope and accelerometer, a tone. What counts is that nothing
crashes, telemetry holds the samples of one tick, every frame is sound, each tick obeys a command that was
sent, a request is answered, each edge is counted, a motor that reverses rests, no tone leaves a motor on, the
gyroscope goes on and no fault appears that nobody caused.
"""

import argparse
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.firmware.board.boot import ELF
from tests.firmware.board.wire import run_for, send
from tests.firmware.preemption.scenarios import LONGEST_PULSE_S, SHORTEST_REST_S, uncounted
from thumper.board.framing import FrameDecoder
from thumper.board.messages import (
    PARAMETERS,
    Command,
    CommandRequest,
    Fault,
    GetParameter,
    GyroscopeState,
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
TAIL_S = 4.5e-3
TICK_S = 0.1
REST_S = 0.012
EDGES = (Interrupt.LEFT_EDGE, Interrupt.RIGHT_EDGE)


@dataclass(frozen=True, slots=True)
class Phase:
    """What the host sends at its start, what the robot does then, and the faults that follow."""

    requests: tuple[Message, ...]
    drives: bool = True
    window_s: float = 0.11  # more than a control tick and a battery reading
    tail_s: float = TAIL_S
    faults: tuple[Fault, ...] = (Fault.NONE,)


PHASES: dict[str, Phase] = {
    "driving": Phase((SetWheelSpeeds(left=OTHER[0], right=OTHER[1]),)),
    "reversal": Phase((SetMotorPwm(left=PWM[0], right=PWM[1]),), tail_s=REST_S),
    "questions": Phase(
        (Identify(), GetParameter(index=3), GetParameter(index=99), CommandRequest(command=99))  # type: ignore[arg-type]
    ),
    "parameters": Phase((SetParameter(index=0, value=900), SetParameter(index=0, value=-1))),
    "save": Phase((CommandRequest(command=Command.SAVE),)),
    "whole save": Phase((CommandRequest(command=Command.SAVE),), drives=False, window_s=0.3),
    "disarm": Phase((CommandRequest(command=Command.DISARM),)),
    "stop": Phase(
        (CommandRequest(command=Command.E_STOP), CommandRequest(command=Command.CLEAR_FAULT)),
        faults=(Fault.NONE, Fault.E_STOP),
    ),
    "load": Phase(
        (CommandRequest(command=Command.LOAD), CommandRequest(command=Command.RESTORE_DEFAULTS)), drives=False
    ),
    # The pack is called empty: a tone of 0.2 s begins and ends.
    "tone": Phase(
        (SetParameter(index=INDEX["battery_stop"], value=4000),),
        drives=False,
        window_s=0.45,
        tail_s=REST_S,
        faults=(Fault.NONE, Fault.LOW_BATTERY),
    ),
}


def entry(state: State, pair: tuple[int, int]) -> bytes:
    """Return a command as the control tick finds it."""
    return bytes((state,)) + b"".join(value.to_bytes(2, "little", signed=True) for value in pair)


COMMANDS = {
    *(entry(State.CLOSED_LOOP, pair) for pair in (SPEEDS, OTHER, (0, 0))),
    *(entry(State.MANUAL, pair) for pair in (PWM, (0, 0))),
    entry(State.DISARMED, (0, 0)),
    entry(State.FAULT, (0, 0)),
}


def robot(elf: Path, *, sensors: bool, drives: bool) -> SweptChip:
    """Return a robot, with or without gyroscope and accelerometer, that drives or is at rest."""
    chip = SweptChip(elf, params=RobotParams.load(), seed=1)
    chip.fit_gyroscope()
    run_for(chip, 0.305)
    for sensor in ("gyroscope", "tilt_limit") if sensors else ():
        send(chip, SetParameter(index=INDEX[sensor], value=1))
    if drives:
        send(chip, CommandRequest(command=Command.ARM))
    for _ in range(6 if sensors else 0):
        send(chip, SetWheelSpeeds(left=SPEEDS[0], right=SPEEDS[1]))
        run_for(chip, 0.09)
    return chip


def failures_of(branch: Branch, interrupt: Interrupt, phase: Phase) -> Iterator[str]:
    """Yield what went wrong in a branch of a robot with sensors."""
    if branch.crashed:
        yield "crashed"
        return
    decoder = FrameDecoder()
    frames = decoder.feed(branch.received)
    if decoder.errors:
        yield "a damaged frame"
    payloads = [frame.payload for frame in frames if frame.message_id == Telemetry.ID]
    told = [Telemetry.unpack(payload) for payload in payloads]
    if any(payload[: len(branch.exits[0])] not in branch.exits for payload in payloads):
        yield "telemetry mixes two ticks"
    if any(found not in COMMANDS for found in branch.entries[1:]):  # the first one is from before the branch
        yield "a tick obeys a command that nobody sent"
    early_s = 1e-3 if interrupt is Interrupt.MILLISECOND else 0.0  # a forced one has not really passed
    if min(branch.shortest_rest_s) < SHORTEST_REST_S - early_s:
        yield f"a motor rested {1000 * min(branch.shortest_rest_s):.2f} ms"
    if max(branch.longest_pulse_s) > LONGEST_PULSE_S:
        yield f"a motor was on for {1e6 * max(branch.longest_pulse_s):.0f} us outside its timer"
    if any(sample.fault not in phase.faults for sample in told):
        yield "a fault that nobody caused"
    if phase.drives and any(sample.gyroscope is GyroscopeState.MISSING for sample in told):
        yield "the gyroscope is missing"
    if interrupt is Interrupt.TICK and not told:
        yield "no telemetry"
    if interrupt is Interrupt.RECEIVE and not any(frame.message_id == Identity.ID for frame in frames):
        yield "a request was lost"


def sweep(elf: Path, phase: Phase, interrupt: Interrupt, visits: int) -> tuple[set[int], list[str]]:
    """Return the addresses that were swept in one phase, and the failures."""
    edge = interrupt in EDGES
    chip = robot(elf, sensors=not edge, drives=phase.drives and not edge)
    chip.receive(chip.available)
    for request in phase.requests:
        send(chip, request)
    until_telemetry = interrupt in {*EDGES, Interrupt.ANALOGUE, Interrupt.I2C}
    branches = chip.sweep(
        interrupt,
        seconds=phase.window_s,
        tail_s=TICK_S + TAIL_S if until_telemetry else phase.tail_s,
        watch=(symbol(elf, "command"), symbol(elf, "samples")),
        per_address=visits,
    )
    failures = [
        f"{branch.address:#06x}: {text}"
        for branch in branches
        for text in (
            uncounted(branch, interrupt, phase.faults) if edge else failures_of(branch, interrupt, phase)
        )
    ]
    return {branch.address for branch in branches}, failures


def main_loop_addresses(elf: Path) -> set[int]:
    """Return the addresses of all instructions of main(), start-up included, and of what it calls."""
    text = subprocess.run(["avr-objdump", "-d", elf], capture_output=True, text=True, check=True).stdout
    functions = {part.partition(">:")[0]: part for part in re.split(r"^\w+ <", text, flags=re.MULTILINE)}
    found: set[str] = set()
    waiting = {"main"}
    while waiting:
        name = waiting.pop()
        found.add(name)
        targets = re.findall(r"\b(?:r?call|r?jmp|br\w\w)\s.*<([\w.]+)", functions[name])
        waiting |= {*targets} & functions.keys() - found
    lines = (re.findall(r"^ +(\w+):\t", functions[name], re.MULTILINE) for name in found)
    return {int(address, 16) for addresses in lines for address in addresses}


def spent_s() -> float:
    """Return the processor time of this process and of all branches."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


def main() -> int:
    """Sweep; print how many instructions were reached and what failed; return 1 if anything did."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--visits", type=int, default=1, help="how often at each address, in each phase")
    parser.add_argument("--only", nargs="+", default=[i.name for i in Interrupt], help="interrupts")
    parser.add_argument("--phases", nargs="+", choices=PHASES, default=list(PHASES))
    arguments = parser.parse_args()
    failed = False
    every = main_loop_addresses(ELF)
    for name in arguments.only:
        interrupt, start_s = Interrupt[name], spent_s()
        reached: set[int] = set()
        failures: list[str] = []
        for phase in arguments.phases:
            # The motors are off in the edge sweep: phases that drive would turn the wheels.
            if interrupt in EDGES and phase in ("reversal", "tone"):
                continue
            addresses, found = sweep(ELF, PHASES[phase], interrupt, arguments.visits)
            reached |= addresses
            failures += [f"{phase}, {text}" for text in found]
        if not reached:
            failures.append("no instruction was swept")
        failed = failed or bool(failures)
        seconds = spent_s() - start_s
        share = f"{len(reached)} of {len(every)} instructions"
        print(f"{name}: {share}, {len(failures)} failures, {seconds:.0f} s", flush=True)
        print(*failures[:8], sep="\n", end="\n" if failures else "", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
