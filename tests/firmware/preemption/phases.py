"""What the robot goes through in the sweep of the whole main loop. Together all that the main loop does."""

from collections.abc import Callable
from dataclasses import dataclass

from tests.firmware.board.wire import run_for, send
from thumper.board.framing import encode_frame
from thumper.board.messages import (
    PARAMETERS,
    Command,
    CommandRequest,
    Fault,
    GetParameter,
    Identify,
    Message,
    SetMotorPwm,
    SetParameter,
    SetWheelSpeeds,
)
from thumper_hil.chip.chip_faults import SideFaults
from thumper_hil.chip.preemption import SweptChip, symbol

INDEX = {spec.name: spec.index for spec in PARAMETERS}
SPEEDS, OTHER = (0x0102, 0x0304), (-0x0506, -0x0708)
SCRUB, FAST = (-400, 3000), (17_000, -17_000)
PWM, FULL, BACKWARD = (100, -100), (255, 200), (-200, -255)
TAIL_S, REST_S = 4.5e-3, 0.012
MCUSR = 0x54
SIDES = ("left", "right")
SILENT = (Fault.NONE, Fault.LINK_LOST)  # a branch may run for more than 0.3 s after the last command
PARAMETER_SLOT = 0x20


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """What the host sends at its start, what happens to the robot before, and the faults that follow."""

    requests: tuple[Message | bytes, ...] = ()
    before: Callable[[SweptChip], None] = lambda _chip: None
    drives: bool = True
    window_s: float = 0.11  # more than a control tick and a battery reading
    tail_s: float = TAIL_S
    faults: tuple[Fault, ...] = (Fault.NONE,)
    edges: bool = True  # also swept with edges, of wheels at rest
    rare: bool = True  # only the instructions that no phase before it reached
    gyroscope: bool = True  # it must not go missing
    starts: bool = False  # from the reset on, with interrupts off at first


def command(value: Command) -> CommandRequest:
    """Return a request for the supervisor or the parameter store."""
    return CommandRequest(command=value)


def setting(name: str, value: int) -> SetParameter:
    """Return a request that sets a parameter to a wire value."""
    return SetParameter(index=INDEX[name], value=value)


def after(wait_s: float, *steps: Message | Callable[[SweptChip], None]) -> Callable[[SweptChip], None]:
    """Return what sends messages and changes the robot, and then waits."""

    def run(chip: SweptChip) -> None:
        for step in steps:
            if callable(step):
                step(chip)
            else:
                send(chip, step)
                run_for(chip, 2e-3)
        run_for(chip, wait_s)

    return run


def starting(reset_flags: int, eeprom: bytes = b"") -> Callable[[SweptChip], None]:
    """Return what resets the chip, for these reasons (MCUSR), with this content of a slot."""

    def run(chip: SweptChip) -> None:
        if eeprom:
            chip.write_eeprom(eeprom, PARAMETER_SLOT)
        chip.reset()
        chip.poke(MCUSR, reset_flags)

    return run


def with_jammed_wheels(chip: SweptChip) -> None:
    """Block the left wheels and swap the right motor's leads."""
    chip.set_side_faults(0, SideFaults(blocked=True))
    chip.set_side_faults(1, SideFaults(reversed=True))


DRIVE = SetMotorPwm(left=FULL[0], right=FULL[1])
GARBAGE = (
    b"\x00" + 70 * b"\x55" + b"\x00",  # too long
    encode_frame(Identify.ID, 3, b"")[:-2] + b"\x01\x00",  # wrong CRC
    encode_frame(0x77, 3, b""),
    encode_frame(SetParameter.ID, 3, b"\x01"),
    b"\x09\x01\x00",  # ends within a block
    b"\x00\x00",
)

PHASES: dict[str, Phase] = {
    "driving": Phase(requests=(SetWheelSpeeds(left=OTHER[0], right=OTHER[1]),), rare=False),
    "reversal": Phase(
        requests=(SetMotorPwm(left=PWM[0], right=PWM[1]),), tail_s=REST_S, rare=False, edges=False
    ),
    "questions": Phase(
        requests=(
            Identify(),
            GetParameter(index=3),
            GetParameter(index=99),
            CommandRequest(command=99),  # type: ignore[arg-type]
        ),
        rare=False,
    ),
    "parameters": Phase(
        requests=(SetParameter(index=0, value=900), SetParameter(index=0, value=-1)), rare=False
    ),
    "save": Phase(requests=(command(Command.SAVE),), rare=False),
    "whole save": Phase(requests=(command(Command.SAVE),), drives=False, window_s=0.3, rare=False),
    "disarm": Phase(requests=(command(Command.DISARM),), rare=False),
    "stop": Phase(
        requests=(command(Command.E_STOP), command(Command.CLEAR_FAULT)),
        faults=(Fault.NONE, Fault.E_STOP),
        rare=False,
    ),
    "load": Phase(
        requests=(command(Command.LOAD), command(Command.RESTORE_DEFAULTS)), drives=False, rare=False
    ),
    # The pack is called empty: a tone of 0.2 s begins and ends.
    "tone": Phase(
        requests=(setting("battery_stop", 4000),),
        drives=False,
        window_s=0.45,
        tail_s=REST_S,
        faults=(Fault.NONE, Fault.LOW_BATTERY),
        edges=False,
        rare=False,
    ),
    "one wheel held by the floor": Phase(
        requests=(SetWheelSpeeds(left=SCRUB[0], right=SCRUB[1]),), window_s=0.25, edges=False
    ),
    "jammed wheels": Phase(
        requests=(DRIVE,),
        before=after(0.2, with_jammed_wheels, DRIVE),
        window_s=0.25,
        faults=(Fault.NONE, Fault.STALL_LEFT, Fault.REVERSED_RIGHT, Fault.OVER_CURRENT),
        edges=False,
    ),
    "the other wheel held by the floor": Phase(
        requests=(SetWheelSpeeds(left=-SCRUB[1], right=-SCRUB[0]),), window_s=0.25, edges=False
    ),
    "jammed backward": Phase(
        requests=(SetMotorPwm(left=BACKWARD[0], right=BACKWARD[1]),),
        before=after(0.2, with_jammed_wheels, SetMotorPwm(left=BACKWARD[0], right=BACKWARD[1])),
        window_s=0.25,
        faults=(Fault.NONE, Fault.STALL_LEFT, Fault.REVERSED_RIGHT, Fault.OVER_CURRENT),
        edges=False,
    ),
    "beyond the limits": Phase(
        requests=(
            SetWheelSpeeds(left=32_000, right=-32_000),
            SetWheelSpeeds(left=-32_000, right=32_000),
            SetMotorPwm(left=1000, right=-1000),
            SetMotorPwm(left=-1000, right=1000),
        ),
        window_s=0.03,
        tail_s=REST_S,
        edges=False,
    ),
    "refused while armed": Phase(
        requests=(
            setting("track", 300),
            command(Command.RESTORE_DEFAULTS),
            command(Command.LOAD),
            command(Command.ARM),
        ),
        window_s=0.03,
    ),
    "refused while disarmed": Phase(
        requests=(DRIVE, SetWheelSpeeds(left=1, right=2), SetParameter(index=99, value=0)),
        drives=False,
        window_s=0.03,
    ),
    "another fault after a fault": Phase(
        requests=(command(Command.ARM), setting("battery_stop", 4000)),
        before=after(0.03, setting("input_1", 2)),
        drives=False,
        window_s=0.2,
        tail_s=REST_S,
        faults=(Fault.INPUT_1, Fault.LOW_BATTERY),
        edges=False,
    ),
    "a fault after an emergency stop": Phase(
        requests=(command(Command.ARM), setting("battery_stop", 4000), setting("input_1", 2)),
        before=after(0.03, command(Command.E_STOP)),
        drives=False,
        window_s=0.2,
        tail_s=REST_S,
        faults=(Fault.E_STOP,),
        edges=False,
    ),
    "coarse encoder": Phase(
        requests=(SetWheelSpeeds(left=SPEEDS[0], right=SPEEDS[1]),),
        before=after(
            0.25,
            setting("counts_per_rev", 40),
            setting("acceleration", 20_000),
            command(Command.ARM),
            SetWheelSpeeds(left=FAST[0], right=FAST[1]),
        ),
        drives=False,
        window_s=0.25,
        faults=(Fault.NONE, Fault.REVERSED_LEFT, Fault.REVERSED_RIGHT),
        edges=False,
    ),
    "lost edges": Phase(
        requests=(SetWheelSpeeds(left=OTHER[0], right=OTHER[1]),),
        before=after(0.0, lambda chip: chip.poke(symbol(chip.elf, "left_encoder").address + 4, 99)),
        window_s=0.25,
        faults=(Fault.NONE, Fault.LOST_EDGES),
        edges=False,
    ),
    "silent host": Phase(window_s=0.35, faults=(Fault.NONE, Fault.LINK_LOST), edges=False),
    "damaged frames": Phase(requests=GARBAGE, edges=False),
    "another robot": Phase(
        requests=(
            setting("currents_at_a4", 1),
            setting("gyroscope", 0),
            setting("currents_at_a4", 1),
            setting("gyroscope", 1),
            setting("current_scale", 30_720),
            setting("current_zero", 0),
            *(setting(f"{side}_{part}_reversed", 1) for side in SIDES for part in ("motor", "encoder")),
            Identify(),
        ),
        drives=False,
        window_s=0.15,
        edges=False,
    ),
    # One each: settings that arrive together may be taken together.
    **{
        f"{name} {value}": Phase(requests=(setting(name, value),), drives=False, window_s=0.02, edges=False)
        for name, value in (
            *(("pwm_frequency", Hz) for Hz in (31_373, 3922, 980, 490, 245)),
            ("kv", 0),
            ("ka", 1),
            ("tilt_limit", 0),
        )
    },
    "seven cells": Phase(
        requests=(setting("kv", 31_457), setting("battery_stop", 2500), setting("battery_cells", 7)),
        drives=False,
        window_s=0.2,
        tail_s=REST_S,
        faults=(Fault.NONE, Fault.LOW_BATTERY),
        edges=False,
    ),
    "gyroscope upside down": Phase(
        requests=(setting("gyroscope", 2),), drives=False, window_s=0.2, gyroscope=False
    ),
    "high battery": Phase(
        requests=(setting("battery_cells", 1),), drives=False, faults=(Fault.NONE, Fault.HIGH_BATTERY)
    ),
    "refused by a high battery": Phase(
        requests=(command(Command.ARM), command(Command.CLEAR_FAULT), command(Command.SAVE)),
        before=after(0.12, setting("battery_cells", 1)),
        drives=False,
        window_s=0.03,
        faults=(Fault.HIGH_BATTERY,),
    ),
    "refused by a low battery": Phase(
        requests=(command(Command.CLEAR_FAULT), command(Command.SAVE)),
        before=after(0.12, setting("battery_stop", 4000)),
        drives=False,
        window_s=0.03,
        tail_s=REST_S,
        faults=(Fault.LOW_BATTERY,),
        edges=False,
    ),
    "analogue converter stops": Phase(
        before=after(0.0, lambda chip: chip.stop_adc(stopped=True)), faults=(Fault.NONE, Fault.ADC_STOPPED)
    ),
    "refused without a battery reading": Phase(
        requests=(command(Command.CLEAR_FAULT), command(Command.ARM)),
        before=after(0.1, lambda chip: chip.stop_adc(stopped=True)),
        drives=False,
        window_s=0.03,
        faults=(Fault.ADC_STOPPED,),
    ),
    "protecting inputs": Phase(
        requests=(setting("input_2", 2), setting("input_1", 2)),
        window_s=0.03,
        drives=False,
        faults=(Fault.NONE, Fault.INPUT_1, Fault.INPUT_2),
    ),
    "inputs to ground": Phase(
        requests=(setting("input_2", 1), setting("input_1", 1)),
        before=after(
            0.0,
            lambda chip: chip.set_switch(1, closed=True),
            lambda chip: chip.set_switch(2, closed=True),
        ),
        window_s=0.03,
        drives=False,
        faults=(Fault.NONE, Fault.INPUT_1, Fault.INPUT_2),
    ),
    "refused by an input": Phase(
        requests=(command(Command.CLEAR_FAULT), setting("input_1", 1)),
        before=after(0.03, setting("input_1", 2)),
        window_s=0.03,
        drives=False,
        faults=(Fault.INPUT_1,),
    ),
    "tilted": Phase(
        requests=(SetWheelSpeeds(left=SPEEDS[0], right=SPEEDS[1]),),
        before=after(0.22, setting("tilt_limit", 76), command(Command.ARM)),
        drives=False,
        faults=(Fault.NONE, Fault.TILTED),
        edges=False,
    ),
    "level again": Phase(
        before=after(
            5e-3,
            setting("tilt_limit", 20),
            command(Command.ARM),
            lambda chip: chip.set_attitude(pitch_rad=1.5),
            lambda chip: run_for(chip, 0.05),
            lambda chip: chip.set_attitude(pitch_rad=0.0),
            SetWheelSpeeds(left=SPEEDS[0], right=SPEEDS[1]),
        ),
        drives=False,
        window_s=0.03,
        edges=False,
    ),
    "impact": Phase(
        before=after(
            0.02,
            setting("tilt_limit", -76),
            setting("impact_limit", 5),
            command(Command.ARM),
            lambda chip: chip.set_attitude(pitch_rad=0.5),
        ),
        drives=False,
        faults=(Fault.NONE, Fault.IMPACT),
        edges=False,
    ),
    **{
        f"gyroscope {name}": Phase(
            before=after(0.0, *actions), window_s=window_s, faults=SILENT, gyroscope=False
        )
        for name, window_s, actions in (
            ("absent", 0.25, (lambda chip: chip.power_gyroscope(on=False),)),
            (
                "returns",
                0.25,
                (
                    lambda chip: chip.power_gyroscope(on=False),
                    lambda chip: run_for(chip, 0.1),
                    lambda chip: chip.power_gyroscope(on=True),
                ),
            ),
            ("frozen", 0.2, (lambda chip: chip.freeze_gyroscope(frozen=True),)),
            ("holds SDA", 0.25, (lambda chip: chip.hold_twi_data(pulses=-1),)),
        )
    },
    "gyroscope's bias": Phase(before=after(0.4), drives=False, window_s=0.7),
    "load a saved set": Phase(
        requests=(command(Command.LOAD),),
        before=after(0.3, command(Command.SAVE), lambda chip: run_for(chip, 0.3), command(Command.SAVE)),
        drives=False,
        window_s=0.03,
    ),
    "load from the first slot": Phase(
        requests=(command(Command.LOAD),),
        before=after(0.3, command(Command.SAVE)),
        drives=False,
        window_s=0.03,
    ),
    "load what is unreadable": Phase(
        requests=(command(Command.LOAD),),
        before=after(0.0, lambda chip: chip.write_eeprom(b"\x05\x06", PARAMETER_SLOT)),
        drives=False,
        window_s=0.03,
    ),
    "a save that fails": Phase(
        before=after(
            0.0,
            command(Command.SAVE),
            lambda chip: run_for(chip, 0.1),
            lambda chip: chip.write_eeprom(50 * b"\x55", PARAMETER_SLOT + 1),
        ),
        drives=False,
        window_s=0.3,
    ),
    "two saves": Phase(
        requests=(command(Command.SAVE), setting("kp", 700), command(Command.SAVE)),
        drives=False,
        window_s=0.7,
    ),
    "start, reset pin": Phase(
        before=after(0.0, command(Command.SAVE), lambda chip: run_for(chip, 0.4), starting(2)),
        drives=False,
        edges=False,
        starts=True,
        tail_s=0.02,
    ),
    **{
        f"start, {name}": Phase(
            before=starting(flags, eeprom), drives=False, faults=faults, edges=False, starts=True, tail_s=0.02
        )
        for name, flags, eeprom, faults in (
            ("power on", 1, b"", (Fault.NONE,)),
            ("brown-out", 4, b"", (Fault.NONE,)),
            ("watchdog", 8, b"", (Fault.NONE, Fault.WATCHDOG)),
            ("unknown", 0, b"\x05\x06", (Fault.NONE, Fault.BAD_PARAMETERS)),
        )
    },
}
