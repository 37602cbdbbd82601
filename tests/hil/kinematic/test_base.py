"""The kinematic base drives, turns and stops as the full simulator does."""

from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest

from thumper.board.board import Board
from thumper.board.messages import Command
from thumper.board.options import BoardOptions
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.common.kinematics import DriveGeometry, wheel_speeds
from thumper_hil.bench import simulation
from thumper_hil.bench.registry import forget_simulation
from thumper_hil.kinematic.base import BOARD_DELAY_S, TICK_S, KinematicBase

DRIVE_S, STOP_S = 2.0, 1.5


def on_bench(twist: Twist2) -> tuple[FloatArray, FloatArray]:
    """Return length [m] and turn [rad] of the drive, and of the stop, of the firmware."""
    with closing(Board.open("sim://base/board?world=hall", baud=BoardOptions().baud)) as board:
        bench = simulation("base")
        board.command(Command.ARM)
        starts_s = []
        for target, duration_s in ((Twist2(), 0.3), (twist, DRIVE_S), (Twist2(), STOP_S)):
            starts_s.append(bench.time_s)
            while bench.time_s < starts_s[-1] + duration_s - 1e-6:
                board.set_wheel_speeds(wheel_speeds(target, DriveGeometry()))
                board.poll(TICK_S)
        truth = bench.truth()
    forget_simulation("base")
    drive = (truth[:, 0] >= starts_s[1]) & (truth[:, 0] <= starts_s[2])
    return _way(truth[drive, 1:4]), _way(truth[truth[:, 0] >= starts_s[2], 1:4])


def in_arena(twist: Twist2) -> tuple[FloatArray, FloatArray]:
    """Return the same of the kinematic base."""
    base = KinematicBase(Pose2(), delay_s=BOARD_DELAY_S)
    poses = np.array(list(_poses(base, twist)))
    driven = round(DRIVE_S / TICK_S) + 1
    return _way(poses[:driven]), _way(poses[driven - 1 :])


def _poses(base: KinematicBase, twist: Twist2) -> Iterator[tuple[float, float, float]]:
    yield 0.0, 0.0, 0.0
    for tick in range(round((DRIVE_S + STOP_S) / TICK_S)):
        base.step(twist if tick * TICK_S < DRIVE_S - 1e-9 else Twist2())
        yield base.pose.x_m, base.pose.y_m, base.pose.theta_rad


def _way(poses: FloatArray) -> FloatArray:
    turn_rad = np.ptp(np.unwrap(poses[:, 2]))
    return np.array((np.hypot(*np.diff(poses[:, :2], axis=0).T).sum(), turn_rad))


@pytest.mark.parametrize(
    ("twist", "tolerance"),
    [(Twist2(v_m_s=0.4), 0.05), (Twist2(v_m_s=0.3, w_rad_s=0.8), 0.15), (Twist2(w_rad_s=1.2), 0.15)],
    ids=["straight", "bend", "turn"],
)
def test_it_drives_and_stops_as_the_firmware_does(twist: Twist2, tolerance: float) -> None:
    """Tyres and their noise differ by the random numbers, so a turn does by up to a fifth."""
    for ours, firmware in zip(in_arena(twist), on_bench(twist), strict=True):
        assert ours[0] == pytest.approx(firmware[0], rel=tolerance, abs=0.01)
        assert ours[1] == pytest.approx(firmware[1], rel=0.20, abs=0.02)


@pytest.mark.parametrize(("preset", "least_m", "most_m"), [("nominal", 0.0, 0.001), ("hard", 0.02, 0.12)])
def test_hard_turns_about_another_centre(preset: str, least_m: float, most_m: float) -> None:
    ways_m = []
    for seed in range(20):
        base = KinematicBase(Pose2(), preset=preset, seed=seed)
        for _ in range(150):  # about half a turn moves the middle by twice the offset of the centre
            base.step(Twist2(w_rad_s=1.2))
        ways_m.append(base.pose.distance_m(Pose2()))
    assert least_m <= np.mean(ways_m) <= most_m
