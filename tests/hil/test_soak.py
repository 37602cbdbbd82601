"""Two simulated minutes of the soak; `python -m thumper_hil.soak` runs for hours."""

from thumper_hil.soak import soak


def test_a_robot_outlives_its_faults() -> None:
    report = soak(120.0, seed=2)
    assert report.complaints == []
    assert report.drives >= 6
    assert report.reached >= 3
    assert sum(report.faults.values()) >= 2
    assert report.contacts == 0
