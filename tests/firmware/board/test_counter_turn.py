"""Turns in which one side runs slowly against the other: scrub holds it for seconds, and that is no fault."""

import pytest

from tests.variants import some_of
from thumper.board.board import Board
from thumper.board.messages import Command, Fault
from thumper.common.kinematics import WheelSpeeds
from thumper_hil.bench import Bench, simulation
from thumper_hil.chip.chip_faults import WireFault

LEFT, A, B = 0, 0, 1
SETTLED_S = 1.5
FOLLOWS_RAD = 0.1
"""Rotation of the slow wheel, in its direction, that shows that it follows in the end."""


def drive(
    left_rad_s: float,
    right_rad_s: float,
    *,
    wiring: str = "good",
    options: str = "",
    stall_current_A: float = 15.0,
    seconds: float = 12.0,
) -> tuple[Fault, float, float]:
    """Drive until a fault or for `seconds`; return the fault, the time [s] and the left wheel's rotation."""
    name = f"counter-turn-{left_rad_s}-{right_rad_s}-{wiring}-{options}-{stall_current_A}".replace(
        "&", "-"
    ).replace("=", "-")
    board = Board.open(f"sim://{name}/board?seed=2{options}", baud=500_000)
    bench: Bench = simulation(name)
    while bench.time_s < SETTLED_S:
        board.poll(0.2)
    board.set_parameter("stall_current", stall_current_A)
    if wiring == "cut":
        for channel in (A, B):
            bench.chip.set_wire_fault(LEFT, channel, WireFault.CUT)
    if wiring == "swapped":
        bench.chip.swap_channels(LEFT, swapped=True)
    board.command(Command.ARM)
    start_s, start_rad, fault = bench.time_s, bench.chip.truth().wheel_rad[LEFT], Fault.NONE
    while fault is Fault.NONE and bench.time_s < start_s + seconds:
        board.set_wheel_speeds(WheelSpeeds(left_rad_s=left_rad_s, right_rad_s=right_rad_s))
        for sample in board.poll(0.5):
            fault = sample.telemetry.fault
    turned_rad = bench.chip.truth().wheel_rad[LEFT] - start_rad
    board.close()
    return fault, bench.time_s - start_s, turned_rad


@pytest.mark.parametrize(
    "options", some_of(["", "&preset=hard&floor=carpet", "&floor=carpet", "&preset=hard"], 2)
)
@pytest.mark.parametrize(("left_rad_s", "right_rad_s"), [(-0.1, 1.0), (-0.2, 2.0), (-0.6, 2.0)])
def test_a_wheel_held_by_the_floor_is_no_stall(left_rad_s: float, right_rad_s: float, options: str) -> None:
    fault, _, turned_rad = drive(left_rad_s, right_rad_s, options=options)
    assert fault is Fault.NONE
    assert turned_rad < -FOLLOWS_RAD


@pytest.mark.parametrize(
    ("left_rad_s", "limit_rad", "stall_current_A"), [(-0.2, 3.5, 15.0), (-0.6, 2.0, 15.0), (-0.6, 2.0, 45.0)]
)
def test_a_dead_encoder_is_still_found(left_rad_s: float, limit_rad: float, stall_current_A: float) -> None:
    """A wheel that turns draws less than one that is held."""
    fault, time_s, turned_rad = drive(left_rad_s, 2.0, wiring="cut", stall_current_A=stall_current_A)
    assert fault is Fault.STALL_LEFT
    assert time_s < 5.0
    assert abs(turned_rad) < limit_rad


@pytest.mark.parametrize("left_rad_s", [-0.05, -0.2, -0.6])
def test_a_reversed_encoder_is_found_while_the_body_drags_its_wheel(left_rad_s: float) -> None:
    """The controller then pushes the wheel along and takes that for braking."""
    fault, time_s, turned_rad = drive(left_rad_s, 2.0, wiring="swapped")
    assert fault is Fault.REVERSED_LEFT
    assert time_s < 4.0
    assert abs(turned_rad) < 3.5
