"""The options of a run in another simulated world."""

from pathlib import Path

import pytest

from thumper.cli.robot_run import RunOptions


@pytest.mark.parametrize(
    ("board", "config", "expected"),
    [
        ("sim://", "", "sim://?world=hall"),
        ("sim://?world=lab&x_m=1&yaw_deg=90&seed=3", "", "sim://?world=hall&seed=3"),
        ("", 'port = "sim://setup/board?world=lab"', "sim://setup/board?world=hall"),
    ],
)
def test_another_world_keeps_the_robot_and_starts_a_new_map(
    tmp_path: Path, board: str, config: str, expected: str
) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(f"[board]\n{config}\n")
    options = RunOptions(
        config=path,
        board=board,
        lidar="",
        bus="",
        start=(1.0, 0.0, 90.0),
        session=tmp_path / "map.session",
        out=tmp_path,
        record=False,
        record_to=None,
    )
    other = options.in_world("hall", tmp_path / "hall")
    assert (other.board, other.start, other.session, other.out) == (expected, None, None, tmp_path / "hall")
    assert other.fresh
