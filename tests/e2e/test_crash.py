"""kill -9 at random moments: the next run goes on in the same map, at the right pose."""

from pathlib import Path

from tests.e2e.crash import crashes, is_good


def test_killed_robot_goes_on_in_the_same_map(tmp_path: Path) -> None:
    """`python -m tests.e2e.crash` kills it 200 times."""
    for restart in list(crashes(1, 7, tmp_path)):
        assert is_good(restart), restart
