"""The decoder never loses or invents a count on legal walks, and counts what it cannot decide."""

import ctypes

from hypothesis import given, settings
from hypothesis import strategies as st

FORWARD_AB = (0b00, 0b01, 0b11, 0b10)  # bit 0 = A, bit 1 = B; Gray code while A leads B


def signed16(value: int) -> int:
    return (value + 0x8000) % 0x10000 - 0x8000


@settings(max_examples=200, deadline=None)
@given(walk=st.lists(st.sampled_from([-1, 0, +1]), max_size=400), start=st.integers(0, 3))
def test_count_is_the_true_travel(core: ctypes.CDLL, walk: list[int], start: int) -> None:
    """0 is an interrupt whose glitch was over before the pins were read: it must not count."""
    phase = start
    decoder = core.quadrature_new(FORWARD_AB[start])
    for step in walk:
        phase += step
        core.quadrature_step(decoder, FORWARD_AB[phase % 4])
    assert signed16(core.quadrature_count(decoder)) == sum(walk)
    assert core.quadrature_lost(decoder) == 0


@settings(max_examples=200, deadline=None)
@given(walk=st.lists(st.sampled_from([-1, +1, +2, +1, -1]), max_size=200))
def test_a_double_step_is_reported_and_not_guessed(core: ctypes.CDLL, walk: list[int]) -> None:
    phase = 0
    decoder = core.quadrature_new(FORWARD_AB[0])
    for step in walk:
        phase += step
        core.quadrature_step(decoder, FORWARD_AB[phase % 4])
    assert signed16(core.quadrature_count(decoder)) == sum(step for step in walk if step != 2)
    assert core.quadrature_lost(decoder) == walk.count(2)


@settings(max_examples=100, deadline=None)
@given(deltas=st.lists(st.integers(-32768, 32767), max_size=200))
def test_position_unwraps_to_32_bits(core: ctypes.CDLL, deltas: list[int]) -> None:
    side = core.side_new()
    position = 0
    for delta in deltas:
        position += delta
        assert core.side_count(side, position % 0x10000) == position
