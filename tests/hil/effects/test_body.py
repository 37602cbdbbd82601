"""Body: loaded tyres, a wandering centre of rotation, pitch, sills; each by itself."""

import itertools
import math
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest

from thumper.board.board import Board
from thumper.board.messages import Command
from thumper.common.geometry import FloatArray, Pose2
from thumper.common.kinematics import WheelSpeeds
from thumper.slam.pose_arrays import to_pose
from thumper_hil.bench import simulation
from thumper_hil.effects.pitch import Pitch
from thumper_hil.effects.preset import BodyEffects, load_preset
from thumper_hil.effects.tyres import rolling_radius_m
from thumper_hil.world.sills import pitch_over_sills_rad

HARD = load_preset("hard").body


def test_a_loaded_wheel_is_3_to_5_percent_small_and_robots_differ() -> None:
    shares = np.array([rolling_radius_m(0.062, HARD, seed) / 0.062 for seed in range(300)])
    assert 0.95 < shares.mean() < 0.97
    assert shares.std() == pytest.approx(HARD.distance_spread, rel=0.2)
    assert rolling_radius_m(0.062, load_preset("nominal").body, 3) == 0.062


def test_a_stop_pitches_the_front_down_and_the_springs_settle() -> None:
    still = Pitch(replace(HARD, pitch_noise_deg=0.0), seed=1)
    for _ in range(200):
        still.step(0.4, 0.01)
    worst = max(still.step(max(0.4 - 0.015 * tick, 0.0), 0.01) for tick in range(60))
    assert math.degrees(worst) == pytest.approx(3.0, abs=1.2)  # 1.5 m/s^2 at 2 degrees per m/s^2, overshoot
    for _ in range(400):
        at_rest = still.step(0.0, 0.01)
    assert abs(at_rest) < 1e-3


def test_the_axles_climb_a_sill() -> None:
    sill = np.array([[1.0, -1.0, 1.0, 1.0, 0.015]])
    pitches = [pitch_over_sills_rad(Pose2(x_m=x), sill) for x in (0.0, 0.86, 1.0, 1.14, 2.0)]
    assert pitches[0] == pitches[2] == pitches[4] == 0.0
    assert pitches[1] == pytest.approx(-math.atan2(0.015, 0.28))  # front axle up
    assert pitches[3] == pytest.approx(math.atan2(0.015, 0.28))


def centres_m(name: str, body: BodyEffects) -> FloatArray:
    """Return the centre of rotation ahead of `base_link`, shape (n,), of a robot that turns for 40 s."""
    preset = replace(load_preset("nominal"), body=body)
    with patch("thumper_hil.bench.bench.load_preset", lambda _name: preset):
        board = Board.open(f"sim://{name}/board?world=hall", baud=500_000)
    board.command(Command.ARM)
    for _ in range(400):
        board.set_wheel_speeds(WheelSpeeds(left_rad_s=-6.0, right_rad_s=6.0))
        board.poll(0.5)
    poses = simulation(name).truth()[200::20, 1:4]
    board.close()
    steps = [to_pose(before).inverse() @ to_pose(after) for before, after in itertools.pairwise(poses)]
    # A point c ahead that stays where it is: the base moves by -c * turn sideways, seen from half the turn.
    return np.array(
        [
            -(step.y_m * math.cos(step.theta_rad / 2) - step.x_m * math.sin(step.theta_rad / 2))
            / (2 * math.sin(step.theta_rad / 2))
            for step in steps
        ]
    )


@pytest.mark.slow
def test_the_centre_of_rotation_wanders() -> None:
    fixed_m = centres_m("fixed", load_preset("nominal").body)
    assert abs(fixed_m).max() < 0.002
    wanders = replace(load_preset("nominal").body, centre_wander_m=HARD.centre_wander_m)
    wandering_m = centres_m("wanders", wanders)
    assert 0.4 * HARD.centre_wander_m < wandering_m.std() < 2.0 * HARD.centre_wander_m
    quick_m = np.abs(np.diff(wandering_m))  # within 0.2 s of the 3 s it takes
    assert np.median(quick_m) < 0.6 * wandering_m.std()
