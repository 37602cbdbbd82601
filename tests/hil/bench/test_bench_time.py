"""A wait on the simulated clock always ends, despite floating-point rounding."""

from hypothesis import given
from hypothesis import strategies as st

from thumper_hil.bench.bench import cycle_at
from thumper_hil.chip.chip import CPU_HZ


@given(now=st.integers(0, 2**45), timeout_s=st.floats(1e-9, 10.0))
def test_cycle_at_is_never_before_its_time(now: int, timeout_s: float) -> None:
    until_s = now / CPU_HZ + timeout_s
    cycle = cycle_at(until_s)
    assert cycle / CPU_HZ >= until_s
    assert (cycle - 2) / CPU_HZ < until_s


def test_cycle_at_for_a_time_that_once_hung() -> None:
    until_s = 52319253 / CPU_HZ + 0.02  # the product with CPU_HZ rounds down to a whole number
    assert cycle_at(until_s) / CPU_HZ >= until_s
