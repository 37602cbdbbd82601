"""What must hold whichever instruction of the main loop an interrupt hits. On demand, everything:

python -m tests.firmware.preemption.scenarios      every instruction of the windows
"""

import sys
from collections.abc import Callable, Iterable
from pathlib import Path

from tests.firmware.board.boot import ELF
from tests.firmware.board.wire import run_for, send
from thumper.board.framing import Frame, FrameDecoder
from thumper.board.messages import (
    PARAMETERS,
    Command,
    CommandRequest,
    Fault,
    GyroscopeState,
    Identify,
    Identity,
    SetMotorPwm,
    SetParameter,
    SetWheelSpeeds,
    State,
    Telemetry,
)
from thumper_hil.chip.chip import CPU_HZ
from thumper_hil.chip.preemption import Branch, Interrupt, SweptChip, symbol
from thumper_hil.chip.robot_params import RobotParams

TICK_S = 0.1
BEFORE_TICK_S, WINDOW_S = 2e-4, 0.8e-3
SHORTEST_REST_S = 0.0099
LONGEST_PULSE_S = 0.32e-3
"""A tone's pulse ends at the next compare match B: 48 us, or 296 us after a forced start."""
TIMSK0, OCIE0B = 0x6E, 1 << 2
INDEX = {spec.name: spec.index for spec in PARAMETERS}
OLD, NEW = (0x0102, 0x0304), (-0x0506, -0x0708)
"""Wheel speeds that share no byte."""

Scenario = Callable[[Path, Interrupt, int], list[str]]
"""(ELF, interrupt, stride) -> what went wrong, with the address; empty if nothing."""


def driving(elf: Path, speed: int = 8000, steps: int = 3, **parameters: int) -> SweptChip:
    """Return a robot that accelerates, so that every field of the samples changes each tick."""
    chip = SweptChip(elf, params=RobotParams.load(), seed=1)
    chip.fit_gyroscope()
    run_for(chip, 0.305)
    for name, value in parameters.items():
        send(chip, SetParameter(index=INDEX[name], value=value))
    send(chip, CommandRequest(command=Command.ARM))
    for _ in range(steps):
        send(chip, SetWheelSpeeds(left=speed, right=-speed))
        run_for(chip, 0.09)
    return chip


def run_to_tick(chip: SweptChip, before_s: float) -> None:
    """Run until `before_s` before the next control tick."""
    start = symbol_of(chip, "samples")
    last = chip.data(start)
    while chip.data(start) == last:
        run_for(chip, 20e-6)
    run_for(chip, TICK_S - before_s)


def symbol_of(chip: SweptChip, name: str) -> int:
    """Return a variable's address."""
    return symbol(chip.elf, name).address


def frames_of(branch: Branch) -> list[Frame]:
    """Return the frames that arrived in a branch."""
    return FrameDecoder().feed(branch.received)


def telemetry_is_whole(elf: Path, interrupt: Interrupt, stride: int) -> list[str]:
    """Each telemetry message holds the samples of one tick, and every frame is sound."""
    chip = driving(elf)
    run_to_tick(chip, BEFORE_TICK_S)
    chip.receive(chip.available)
    samples = symbol(elf, "samples")
    branches = chip.sweep(interrupt, seconds=WINDOW_S, tail_s=4.5e-3, watch=(samples, samples), stride=stride)
    failures = [f"{branch.address:#06x}: {text}" for branch in branches for text in torn(branch, interrupt)]
    return failures if branches else ["no instruction was swept"]


def torn(branch: Branch, interrupt: Interrupt) -> Iterable[str]:
    """Yield what went wrong with telemetry or requests."""
    frames = frames_of(branch)
    told = [frame.payload for frame in frames if frame.message_id == Telemetry.ID]
    if branch.crashed or not told:
        yield "crashed, or no telemetry"
    for payload in told:
        if payload[: len(branch.exits[0])] not in branch.exits:
            yield "telemetry mixes two ticks"
    dropped = sum(Telemetry.unpack(payload).tx_dropped for payload in told[-1:])
    if len(told) + dropped != len(branch.exits):
        yield f"{len(told)} messages and {dropped} counted as dropped of {len(branch.exits)} ticks"
    if interrupt is Interrupt.RECEIVE and not any(frame.message_id == Identity.ID for frame in frames):
        yield "a request was lost"


def command_is_whole(elf: Path, interrupt: Interrupt, stride: int) -> list[str]:
    """Each tick obeys the old command or the new one, never a mixture.

    A forced tick comes amid the command. With another interrupt, the next regular tick must obey the new one.
    """
    chip = driving(elf)
    command = symbol(elf, "command")
    send(chip, SetWheelSpeeds(left=OLD[0], right=OLD[1]))
    forced = interrupt is Interrupt.TICK
    run_to_tick(chip, 0.05 if forced else 0.9e-3)
    send(chip, SetWheelSpeeds(left=NEW[0], right=NEW[1]))
    if forced:
        run_for(chip, 0.2e-3)  # all but the last bytes have arrived
    window_s, tail_s = (0.1e-3, 0.2e-3) if forced else (0.5e-3, 1.2e-3)
    branches = chip.sweep(interrupt, seconds=window_s, tail_s=tail_s, watch=(command, command), stride=stride)
    old, new = (
        bytes((State.CLOSED_LOOP,)) + b"".join(v.to_bytes(2, "little", signed=True) for v in pair)
        for pair in (OLD, NEW)
    )
    allowed = {old, new} if forced else {new}
    seen = {entry for branch in branches for entry in branch.entries}
    failures = [
        f"{branch.address:#06x}: the tick obeys {entry.hex()}"
        for branch in branches
        for entry in branch.entries
        if entry not in allowed
    ]
    failures += [
        f"{branch.address:#06x}: crashed, or no tick"
        for branch in branches
        if branch.crashed or not branch.entries
    ]
    if not allowed <= seen:
        failures.append("the sweep missed the command")
    return failures


def reversal_rests(elf: Path, interrupt: Interrupt, stride: int) -> list[str]:
    """A motor that turns round again just as its rest ends rests again, in full."""
    chip = driving(elf)
    for _ in range(2):
        send(chip, SetMotorPwm(left=100, right=100))
        run_to_tick(chip, 0.02)
    send(chip, SetMotorPwm(left=-100, right=-100))
    run_for(chip, 0.02 + 3e-3)  # the reversal began 3 ms ago
    send(chip, SetMotorPwm(left=100, right=100))
    run_for(chip, 5.5e-3)
    command = symbol(elf, "command")
    branches = chip.sweep(interrupt, seconds=5e-3, tail_s=14e-3, watch=(command, command), stride=stride)
    failures = [
        f"{branch.address:#06x}: the {side} motor rested {1000 * rest:.2f} ms"
        for branch in branches
        for side, rest in zip(("left", "right"), branch.shortest_rest_s, strict=True)
        if rest < SHORTEST_REST_S or branch.crashed
    ]
    if max(branch.shortest_rest_s[0] for branch in branches) > 1.0:
        failures.append("the sweep saw no reversal")
    return failures


def edges_are_counted(elf: Path, interrupt: Interrupt, stride: int) -> list[str]:
    """Each edge is counted and reaches the telemetry of the next tick; a request beside it is answered."""
    chip = SweptChip(elf, params=RobotParams.load(), seed=1)
    run_for(chip, 0.3)
    run_to_tick(chip, BEFORE_TICK_S)
    chip.receive(chip.available)
    send(chip, Identify())
    samples = symbol(elf, "samples")
    branches = chip.sweep(
        interrupt, seconds=WINDOW_S, tail_s=TICK_S + 4e-3, watch=(samples, samples), stride=stride
    )
    failures = [
        f"{branch.address:#06x}: {text}" for branch in branches for text in uncounted(branch, interrupt)
    ]
    failures += [
        f"{branch.address:#06x}: a request was lost"
        for branch in branches
        if all(frame.message_id != Identity.ID for frame in frames_of(branch))
    ]
    return failures if branches else ["no instruction was swept"]


def uncounted(
    branch: Branch, interrupt: Interrupt, faults: tuple[Fault, ...] = (Fault.NONE,)
) -> Iterable[str]:
    """Yield what went wrong after one edge of a stationary robot: with the counts or with any frame."""
    decoder = FrameDecoder()
    told = [frame.payload for frame in decoder.feed(branch.received) if frame.message_id == Telemetry.ID]
    samples = [Telemetry.unpack(payload) for payload in told]
    if branch.crashed or not samples:
        yield "crashed, or no telemetry"
        return
    if decoder.errors:
        yield "a damaged frame"
    if any(payload[: len(branch.exits[0])] not in branch.exits for payload in told):
        yield "telemetry mixes two ticks"
    if any(sample.fault not in faults or sample.rx_errors != 0 for sample in samples):
        yield "a fault or an error of reception"
    last = samples[-1]
    counts = abs(last.left_count), abs(last.right_count)
    expected = (1, 0) if interrupt is Interrupt.LEFT_EDGE else (0, 1)
    if counts != expected or last.lost_edges != 0:
        yield f"counts {counts} and {last.lost_edges} lost after one edge"


def sensors_go_on(elf: Path, interrupt: Interrupt, stride: int) -> list[str]:
    """With gyroscope and accelerometer, the next message is sound and says of no fault."""
    chip = driving(elf, 3000, steps=6, gyroscope=1, tilt_limit=1)
    run_to_tick(chip, 8e-3)
    send(chip, SetWheelSpeeds(left=3000, right=-3000))
    run_for(chip, 1e-3)
    chip.receive(chip.available)
    samples = symbol(elf, "samples")
    branches = chip.sweep(interrupt, seconds=6e-3, tail_s=12e-3, watch=(samples, samples), stride=stride)
    failures = [f"{branch.address:#06x}: {text}" for branch in branches for text in disturbed(branch)]
    return failures if branches else ["no instruction was swept"]


def disturbed(branch: Branch) -> Iterable[str]:
    """Yield what went wrong with telemetry, sensors or drive."""
    told = [Telemetry.unpack(f.payload) for f in frames_of(branch) if f.message_id == Telemetry.ID]
    if branch.crashed or len(told) != 1:
        yield "crashed, or no telemetry after the tick"
    if any(sample.gyroscope is GyroscopeState.MISSING for sample in told):
        yield "the gyroscope is missing"
    if any(sample.fault is not Fault.NONE for sample in told):
        yield "a fault"


def sounding(chip: SweptChip) -> bool:
    """Return whether the motors sound."""
    return bool(chip.data(TIMSK0) & OCIE0B)


def nearly_empty(elf: Path) -> SweptChip:
    """Return a robot at rest whose battery becomes low with the next reading, so that it beeps."""
    chip = SweptChip(elf, params=RobotParams.load(), seed=1)
    run_for(chip, 0.305)
    send(chip, SetParameter(index=INDEX["battery_stop"], value=4000))
    return chip


def tone_leaves_the_motors_off(elf: Path, interrupt: Interrupt, stride: int) -> list[str]:
    """Where a tone begins or ends: no pulse stays on, no motor gets the old duty before it has rested."""
    failures: list[str] = []
    command = symbol(elf, "command")
    scout, chip = nearly_empty(elf), nearly_empty(elf)
    for sounds, tail_s in ((True, 2e-3), (False, 14e-3)):
        while sounding(scout) is not sounds:
            run_for(scout, 20e-6)
        chip.run(scout.cycle - round(40e-6 * CPU_HZ))
        branches = chip.sweep(
            interrupt, seconds=80e-6, tail_s=tail_s, watch=(command, command), stride=stride
        )
        failures += [f"{branch.address:#06x}: {text}" for branch in branches for text in too_loud(branch)]
        failures += [] if branches else ["no instruction was swept"]
    return failures


def too_loud(branch: Branch) -> Iterable[str]:
    """Yield how a tone drove a motor."""
    pulse_s, rest_s = max(branch.longest_pulse_s), min(branch.shortest_rest_s)
    if branch.crashed:
        yield "crashed"
    if pulse_s > LONGEST_PULSE_S:
        yield f"a motor was on for {1e6 * pulse_s:.0f} us"
    if rest_s < SHORTEST_REST_S - 1e-3:  # a forced millisecond has not really passed
        yield f"a motor rested {1000 * rest_s:.2f} ms"


SCENARIOS: dict[Scenario, dict[Interrupt, int]] = {
    telemetry_is_whole: {
        Interrupt.TICK: 13,
        Interrupt.MILLISECOND: 31,
        Interrupt.RECEIVE: 31,
        Interrupt.SEND: 31,
    },
    command_is_whole: {Interrupt.TICK: 1, Interrupt.MILLISECOND: 11},
    reversal_rests: {Interrupt.TICK: 3},
    edges_are_counted: {Interrupt.LEFT_EDGE: 47, Interrupt.RIGHT_EDGE: 47},
    sensors_go_on: {Interrupt.ANALOGUE: 17, Interrupt.I2C: 7},
    tone_leaves_the_motors_off: {Interrupt.TONE_PULSE: 5, Interrupt.MILLISECOND: 5, Interrupt.TICK: 7},
}
"""Each interrupt that a scenario forces, and after every how many instructions the tests do so."""


def main() -> int:
    """Sweep every instruction; return 1 if anything failed."""
    failed = False
    for scenario, interrupts in SCENARIOS.items():
        for interrupt in interrupts:
            failures = scenario(ELF, interrupt, 1)
            failed = failed or bool(failures)
            print(
                f"{scenario.__name__}, {interrupt.name}: {len(failures)} failures", *failures[:5], sep="\n  "
            )
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
