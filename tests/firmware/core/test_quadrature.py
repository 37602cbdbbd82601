"""The decoder never loses or invents a count on legal walks, and counts undecidable steps as lost."""

import ctypes

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thumper.board.messages import State

FORWARD_AB = (0b00, 0b01, 0b11, 0b10)  # bit 0 = A, bit 1 = B; Gray code while A leads B


def signed16(value: int) -> int:
    return (value + 0x8000) % 0x10000 - 0x8000


@settings(max_examples=200, deadline=None)
@given(walk=st.lists(st.sampled_from([-1, 0, +1]), max_size=400), start=st.integers(0, 3))
def test_count_is_the_true_travel(core: ctypes.CDLL, walk: list[int], start: int) -> None:
    """0 is an interrupt whose glitch ended before the pins were read. It must not count."""
    phase = start
    decoder = core.quadrature_new(FORWARD_AB[start])
    for step in walk:
        phase += step
        core.quadrature_step(decoder, FORWARD_AB[phase % 4])
    assert signed16(core.quadrature_count(decoder)) == sum(walk)
    assert core.quadrature_lost(decoder) == 0


@settings(max_examples=200, deadline=None)
@given(walk=st.lists(st.sampled_from([-1, +1, +2, +1, -1]), max_size=200))
def test_a_double_step_counts_as_a_lost_edge(core: ctypes.CDLL, walk: list[int]) -> None:
    phase = 0
    decoder = core.quadrature_new(FORWARD_AB[0])
    for step in walk:
        phase += step
        core.quadrature_step(decoder, FORWARD_AB[phase % 4])
    assert signed16(core.quadrature_count(decoder)) == sum(step for step in walk if step != 2)
    assert core.quadrature_lost(decoder) == walk.count(2)


@settings(max_examples=100, deadline=None)
@given(walk=st.lists(st.sampled_from([-1, +1]), max_size=100), other=st.integers(0, 63))
def test_the_port_s_other_pins_do_not_count(core: ctypes.CDLL, walk: list[int], other: int) -> None:
    phase = 0
    decoder = core.quadrature_new(FORWARD_AB[0])
    for index, step in enumerate(walk):
        phase += step
        core.quadrature_step(decoder, FORWARD_AB[phase % 4] | (other << 2 if index % 2 else 0))
    assert signed16(core.quadrature_count(decoder)) == sum(walk)
    assert core.quadrature_lost(decoder) == 0


@pytest.mark.parametrize("way", [+1, -1])
def test_the_count_carries_over_both_its_bytes(core: ctypes.CDLL, way: int) -> None:
    decoder = core.quadrature_new(FORWARD_AB[0])
    for phase in range(1, 70_000):
        core.quadrature_step(decoder, FORWARD_AB[way * phase % 4])
        if phase % 257 in (0, 1, 255) or phase > 65_530:
            assert core.quadrature_count(decoder) == way * phase % 0x10000


def test_lost_edges_carry_over_both_their_bytes(core: ctypes.CDLL) -> None:
    decoder = core.quadrature_new(0b00)
    for lost in range(1, 1000):
        core.quadrature_step(decoder, 0b11 if lost % 2 else 0b00)
        assert core.quadrature_lost(decoder) == lost


@settings(max_examples=100, deadline=None)
@given(deltas=st.lists(st.integers(-32768, 32767), max_size=200))
def test_position_unwraps_to_32_bits(core: ctypes.CDLL, deltas: list[int]) -> None:
    side = core.side_new()
    out = (ctypes.c_int * 3)()
    position = 0
    for delta in deltas:
        position += delta
        assert core.side_step(side, State.DISARMED, 0, position % 0x10000, 0, out) == position


@settings(max_examples=100, deadline=None)
@given(steps=st.lists(st.tuples(st.integers(-300, 300), st.booleans()), max_size=50))
def test_a_reversed_encoder_counts_the_other_way_and_never_leaps(
    core: ctypes.CDLL, steps: list[tuple[int, bool]]
) -> None:
    side = core.side_new()
    out = (ctypes.c_int * 3)()
    decoded = position = 0
    for delta, reverse in steps:
        decoded += delta
        position += -delta if reverse else delta
        assert core.side_step(side, State.DISARMED, 0, decoded % 0x10000, int(reverse), out) == position


def test_only_the_armed_states_drive(core: ctypes.CDLL) -> None:
    side = core.side_new()
    out = (ctypes.c_int * 3)()
    for state, value, pwm in (
        (State.DISARMED, 100, 0),
        (State.MANUAL, -100, -100),
        (State.MANUAL, 255, 255),
        (State.FAULT, 100, 0),
    ):
        core.side_step(side, state, value, 0, 0, out)
        assert list(out) == [0, pwm, 0]
    core.side_step(side, State.CLOSED_LOOP, 5000, 0, 0, out)
    core.side_step(side, State.CLOSED_LOOP, 5000, 0, 0, out)
    assert (out[0], out[1] > 19) == (800, True)
    core.side_step(side, State.DISARMED, 0, 0, 0, out)
    core.side_step(side, State.CLOSED_LOOP, 0, 0, 0, out)
    assert list(out) == [0, 0, 0], "no residue of the last drive"
