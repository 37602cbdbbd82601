"""Missions: their legs and their ends."""

from thumper.navigation.goal import Goal
from thumper.runtime.drive.legs import Leg
from thumper.runtime.drive.waypoints import MAX_MISSIONS, Missions, MissionState, Waypoint, Waypoints

A, B = Goal(x_m=1.0, y_m=0.0), Goal(x_m=2.0, y_m=0.0)


def test_legs_in_order_and_the_end_after_the_last() -> None:
    missions = Missions()
    number = missions.start(Waypoints.at(A, B)).number
    missions.set_leg(number, 1)
    missions.end(number, "there", reached=True)
    mission = missions.find(number)
    assert mission is not None
    assert (mission.leg, mission.state, mission.reason) == (1, MissionState.REACHED, "there")


def test_a_leg_has_the_name_of_its_place() -> None:
    (leg,) = Waypoints.at(A, place="kitchen").legs()
    assert Leg(goal=leg.goal, name=leg.name).task == "to kitchen"
    places = {"kitchen": A, "hall": B}
    points = tuple(Waypoint(goal=goal, place=name) for name, goal in places.items())
    names = [leg.name for leg in Waypoints(points=points).legs()]
    assert names == ["waypoint 1 of 2, kitchen", "waypoint 2 of 2, hall"]


def test_the_leg_of_an_unknown_mission_is_ignored() -> None:
    missions = Missions()
    missions.set_leg(missions.next_number, 1)
    mission = missions.start(Waypoints.at(A, B))
    assert (mission.number, mission.leg) == (1, 0)


def test_a_new_goal_ends_the_old_one() -> None:
    missions = Missions()
    old = missions.start(Waypoints.at(A)).number
    missions.start(Waypoints.at(B))
    mission = missions.find(old)
    assert mission is not None
    assert mission.state is MissionState.FAILED
    assert "another goal" in mission.reason


def test_end_of_a_mission_that_is_not_active_returns_none() -> None:
    missions = Missions()
    assert missions.end(missions.next_number, "refused") is None
    number = missions.start(Waypoints.at(A)).number
    assert missions.end(missions.next_number, "refused") is None
    assert missions.end(number, "there", reached=True) is not None
    assert missions.end(number, "stopped") is None


def test_old_missions_are_forgotten() -> None:
    missions = Missions()
    first = missions.start(Waypoints.at(A)).number
    for _ in range(MAX_MISSIONS):
        missions.start(Waypoints.at(B))
    assert missions.find(first) is None
    assert missions.newest is not None
