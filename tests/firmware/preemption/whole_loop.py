"""Every instruction of the main loop, with an interrupt forced right after it. On demand:

python -m tests.firmware.preemption.whole_loop                 each instruction once in each common phase
python -m tests.firmware.preemption.whole_loop --visits 4      four times: in other states of the loop
python -m tests.firmware.preemption.whole_loop --only TICK     one interrupt

phases.py lists what the robot goes through. A rare phase adds the instructions that no phase before it
reached. What counts is that nothing
crashes, telemetry holds the samples of one tick, every frame is sound, each tick obeys a command that was
sent, a request is answered, each edge is counted, a motor that reverses rests, no tone leaves a motor on, the
gyroscope goes on and no fault appears that nobody caused.
"""

import argparse
import os
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Set
from pathlib import Path

from tests.firmware.board.boot import ELF
from tests.firmware.board.wire import run_for, send
from tests.firmware.preemption.phases import (
    BACKWARD,
    FAST,
    FULL,
    INDEX,
    OTHER,
    PHASES,
    PWM,
    SCRUB,
    SPEEDS,
    TAIL_S,
    Phase,
)
from tests.firmware.preemption.scenarios import LONGEST_PULSE_S, SHORTEST_REST_S, uncounted
from thumper.board.framing import FrameDecoder
from thumper.board.messages import (
    Command,
    CommandRequest,
    GyroscopeState,
    Identity,
    SetParameter,
    SetWheelSpeeds,
    State,
    Telemetry,
)
from thumper_hil.chip.preemption import Branch, Interrupt, SweptChip, symbol
from thumper_hil.chip.robot_params import RobotParams

TICK_S = 0.1
EDGES = (Interrupt.LEFT_EDGE, Interrupt.RIGHT_EDGE)


def entry(state: State, pair: tuple[int, int]) -> bytes:
    """Return a command as the control tick finds it."""
    return bytes((state,)) + b"".join(value.to_bytes(2, "little", signed=True) for value in pair)


COMMANDS = {
    *(
        entry(State.CLOSED_LOOP, pair)
        for pair in (SPEEDS, OTHER, SCRUB, (-SCRUB[1], -SCRUB[0]), FAST, FAST[::-1], (0, 0))
    ),
    *(entry(State.MANUAL, pair) for pair in (PWM, FULL, BACKWARD, (255, -255), (-255, 255), (0, 0))),
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
    # At a start the pins get their direction for the first time: nothing turns round.
    if not phase.starts and min(branch.shortest_rest_s) < SHORTEST_REST_S - early_s:
        yield f"a motor rested {1000 * min(branch.shortest_rest_s):.2f} ms"
    if max(branch.longest_pulse_s) > LONGEST_PULSE_S:
        yield f"a motor was on for {1e6 * max(branch.longest_pulse_s):.0f} us outside its timer"
    if any(sample.fault not in phase.faults for sample in told):
        yield "a fault that nobody caused"
    if (
        phase.drives
        and phase.gyroscope
        and any(sample.gyroscope is GyroscopeState.MISSING for sample in told)
    ):
        yield "the gyroscope is missing"
    if interrupt is Interrupt.TICK and not told:
        yield "no telemetry"
    if interrupt is Interrupt.RECEIVE and not any(frame.message_id == Identity.ID for frame in frames):
        yield "a request was lost"


def sweep(
    elf: Path, phase: Phase, interrupt: Interrupt, visits: int, skip: Set[int]
) -> tuple[set[int], list[str]]:
    """Return the addresses that were swept in one phase, except `skip`, and the failures."""
    edge = interrupt in EDGES
    chip = robot(elf, sensors=not edge, drives=phase.drives and not edge)
    phase.before(chip)
    chip.receive(chip.available)
    for request in phase.requests:
        if isinstance(request, bytes):
            chip.send(request)
        else:
            send(chip, request)
    until_telemetry = interrupt in {*EDGES, Interrupt.ANALOGUE, Interrupt.I2C}
    branches = chip.sweep(
        interrupt,
        seconds=phase.window_s,
        tail_s=TICK_S + TAIL_S if until_telemetry else phase.tail_s,
        watch=(symbol(elf, "command"), symbol(elf, "samples")),
        per_address=visits,
        skip=skip,
    )
    failures = [
        f"{branch.address:#06x}: {text}"
        for branch in branches
        for text in (
            uncounted(branch, interrupt, phase.faults) if edge else failures_of(branch, interrupt, phase)
        )
    ]
    return {branch.address for branch in branches}, failures


def applies(phase: Phase, interrupt: Interrupt) -> bool:
    """Return whether a phase is swept with an interrupt.

    Edges: only while no wheel turns. Before the first `sei` only what occurs without the main loop's doing.
    """
    if phase.starts:
        return interrupt in {Interrupt.TICK, Interrupt.MILLISECOND}
    return phase.edges or interrupt not in EDGES


def main_loop_addresses(elf: Path) -> dict[int, str]:
    """Return the function of each instruction of main(), start-up included, and of what it calls."""
    text = subprocess.run(["avr-objdump", "-d", elf], capture_output=True, text=True, check=True).stdout
    functions = {part.partition(">:")[0]: part for part in re.split(r"^\w+ <", text, flags=re.MULTILINE)}
    found: set[str] = set()
    waiting = {"main"}
    while waiting:
        name = waiting.pop()
        found.add(name)
        targets = re.findall(r"\b(?:r?call|r?jmp|br\w\w)\s.*<([\w.]+)", functions[name])
        waiting |= {*targets} & functions.keys() - found
    names = sorted(found)
    plain = subprocess.run(["avr-c++filt", "-p", *names], capture_output=True, text=True, check=True).stdout
    return {
        int(address, 16): shown.partition(" [")[0]
        for name, shown in zip(names, plain.splitlines(), strict=True)
        for address in re.findall(r"^ +(\w+):\t", functions[name], re.MULTILINE)
    }


def spent_s() -> float:
    """Return the processor time of this process and of all branches."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


def main() -> int:
    """Sweep; print how many instructions were reached and what failed; return 1 if anything did."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--visits", type=int, default=1, help="how often at each address, in each phase")
    parser.add_argument("--only", nargs="+", default=[i.name for i in Interrupt], help="interrupts")
    parser.add_argument("--elf", type=Path, default=ELF, help="another image")
    parser.add_argument(
        "--phases", nargs="+", choices=PHASES, default=list(PHASES), metavar="PHASE", help="see phases.py"
    )
    arguments = parser.parse_args()
    failed = False
    every = main_loop_addresses(arguments.elf)
    for name in arguments.only:
        interrupt, start_s = Interrupt[name], spent_s()
        reached: set[int] = set()
        failures: list[str] = []
        for phase_name in arguments.phases:
            phase = PHASES[phase_name]
            if not applies(phase, interrupt):
                continue
            skip = frozenset(reached) if phase.rare else frozenset()
            addresses, found = sweep(arguments.elf, phase, interrupt, arguments.visits, skip)
            reached |= addresses
            failures += [f"{phase_name}, {text}" for text in found]
        if not reached:
            failures.append("no instruction was swept")
        failed = failed or bool(failures)
        seconds = spent_s() - start_s
        share = f"{len(reached & every.keys())} of {len(every)} instructions"
        print(f"{name}: {share}, {len(failures)} failures, {seconds:.0f} s", flush=True)
        missing = Counter(every[address] for address in every.keys() - reached)
        print("  not reached:", ", ".join(f"{count} of {name}" for name, count in missing.most_common()))
        print(*failures[:8], sep="\n", end="\n" if failures else "", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
