"""A touch with a leg is the contact of whoever came nearer before it."""

import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper_hil.bench.collision import FOOTPRINT_M
from thumper_hil.bench.leg_contacts import LegContacts

TICK_S = 0.01


def meet(robot_m_s: float, leg_m_s: float) -> tuple[int, int]:
    """Let the robot drive along x towards a leg that walks along x; return contacts and touches by people."""
    contacts = LegContacts(FOOTPRINT_M)
    for tick in range(100):
        leg_m = np.array([[0.5 + leg_m_s * tick * TICK_S, 0.0, 0.06]])
        contacts.check(Pose2(x_m=robot_m_s * tick * TICK_S), leg_m, TICK_S)
    return contacts.by_robot, contacts.by_people


@pytest.mark.parametrize(
    ("robot_m_s", "leg_m_s", "expected"),
    [
        (0.4, 0.0, (1, 0)),  # into a resting leg
        (0.0, -0.8, (0, 1)),  # a person walks into a stationary robot
        (0.2, -1.6, (0, 1)),  # a leg swings into a robot that brakes
        (0.4, -0.1, (1, 0)),
        (0.4, 0.3, (0, 0)),  # it walks away
    ],
)
def test_who_approached_faster(robot_m_s: float, leg_m_s: float, expected: tuple[int, int]) -> None:
    assert meet(robot_m_s, leg_m_s) == expected


def test_a_leg_from_the_side_is_the_persons_though_it_overtakes() -> None:
    contacts = LegContacts(FOOTPRINT_M)
    for tick in range(20):
        leg_m = np.array([[0.05 + 1.3 * tick * TICK_S, 0.24 - 0.5 * tick * TICK_S, 0.06]])
        contacts.check(Pose2(x_m=0.2 * tick * TICK_S), leg_m, TICK_S)
    assert (contacts.by_robot, contacts.by_people) == (0, 1)


@pytest.mark.parametrize(("rested_s", "expected"), [(0.0, (0, 1)), (0.05, (0, 1)), (0.3, (1, 0))])
def test_a_foot_put_down_in_the_way_is_the_persons(rested_s: float, expected: tuple[int, int]) -> None:
    """The robot drives; the foot swings in at 1.3 m/s and rests: too shortly before the touch, or not."""
    contacts = LegContacts(FOOTPRINT_M)
    for tick in range(100):
        to_touch_s = 0.8 - tick * TICK_S
        swings_s = max(0.0, to_touch_s - rested_s)
        leg_m = np.array([[0.27, 0.1 + 1.3 * swings_s, 0.06]])
        contacts.check(Pose2(x_m=0.2 * -to_touch_s), leg_m, TICK_S)
    assert (contacts.by_robot, contacts.by_people) == expected


@pytest.mark.parametrize(("rested_s", "expected"), [(0.0, (0, 2)), (0.1, (0, 2)), (0.3, (1, 1))])
def test_a_leg_that_walks_through_the_robot_and_steps_out_is_the_persons(
    rested_s: float, expected: tuple[int, int]
) -> None:
    """It comes from behind, swings past the driving robot and rests in front; the robot stops at it."""
    contacts = LegContacts(FOOTPRINT_M)
    rests_m = 0.27 + 0.4 * rested_s + 0.02
    for tick in range(200):
        ahead_m = min(-0.4 + 2.0 * tick * TICK_S, rests_m)
        front_m = min(0.4 * max(0.0, tick * TICK_S - 0.35), rests_m - 0.26)
        contacts.check(Pose2(x_m=front_m), np.array([[ahead_m, 0.0, 0.06]]), TICK_S)
    assert (contacts.by_robot, contacts.by_people) == expected


def test_a_leg_that_has_just_appeared_is_compared_over_its_own_time() -> None:
    """In the 0.05 s that the leg is known it comes faster than the robot, which has driven for longer."""
    contacts = LegContacts(FOOTPRINT_M)
    for tick in range(51):
        to_touch_s = (50 - tick) * TICK_S
        leg_m = np.array([[0.26 + 0.6 * to_touch_s, 0.0, 0.06]])
        contacts.check(Pose2(x_m=-0.3 * to_touch_s), leg_m if to_touch_s < 0.055 else leg_m[:0], TICK_S)
    assert (contacts.by_robot, contacts.by_people) == (0, 1)


def test_a_tie_is_the_persons() -> None:
    """Both come equally fast; all lengths are exact in binary."""
    contacts = LegContacts(np.array([[-0.25, -0.125], [0.25, -0.125], [0.25, 0.125], [-0.25, 0.125]]))
    for tick in range(100):
        along_m = (tick - 50) / 512
        contacts.check(Pose2(x_m=along_m), np.array([[0.3125 - along_m, 0.0, 0.0625]]), TICK_S)
    assert (contacts.by_robot, contacts.by_people) == (0, 1)


def test_a_side_that_swings_into_a_passing_leg_is_the_robots() -> None:
    contacts = LegContacts(FOOTPRINT_M)
    for tick in range(40):
        leg_m = np.array([[0.10 + 0.2 * tick * TICK_S, 0.24, 0.06]])
        contacts.check(Pose2(theta_rad=1.0 * tick * TICK_S), leg_m, TICK_S)
    assert contacts.by_robot == 1


def test_a_gap_of_a_few_millimetres_does_not_end_a_touch() -> None:
    contacts = LegContacts(FOOTPRINT_M)
    for x_m, leg_x_m in ((0.0, 0.40), (0.0, 0.26), (0.0, 0.275), (0.006, 0.275)):
        contacts.check(Pose2(x_m=x_m), np.array([[leg_x_m, 0.0, 0.06]]), TICK_S)
    assert (contacts.by_robot, contacts.by_people) == (0, 1)


def test_the_legs_of_a_person_who_turns_round_stay_the_same_legs() -> None:
    contacts = LegContacts(FOOTPRINT_M)
    legs_m = np.array([[0.30, 0.0, 0.06], [0.30, 0.4, 0.06]])
    for tick in range(20):
        legs_m = legs_m - [0.01, 0.0, 0.0]
        order = (0, 1) if tick < 10 else (1, 0)
        contacts.check(Pose2(x_m=0.002 * tick), legs_m[list(order)], TICK_S)
    assert (contacts.by_robot, contacts.by_people) == (0, 1)


def test_a_lasting_touch_counts_once() -> None:
    contacts = LegContacts(FOOTPRINT_M)
    for tick in range(100):
        contacts.check(Pose2(x_m=0.3 * tick * TICK_S), np.array([[0.3, 0.0, 0.06]]), TICK_S)
    assert contacts.by_robot == 1


@pytest.mark.parametrize(("driven_m", "expected"), [(0.04, (0, 1)), (0.06, (1, 1)), (0.6, (1, 1))])
def test_a_robot_that_drives_on_against_a_leg_that_walked_in_has_a_contact(
    driven_m: float, expected: tuple[int, int]
) -> None:
    contacts = LegContacts(FOOTPRINT_M)
    for tick in range(300):
        leg_x_m = max(0.26, 0.6 - 1.0 * tick * TICK_S)
        robot_x_m = min(driven_m, 0.3 * max(0.0, tick * TICK_S - 1.0))
        contacts.check(Pose2(x_m=robot_x_m), np.array([[leg_x_m, 0.0, 0.06]]), TICK_S)
    assert (contacts.by_robot, contacts.by_people) == expected
