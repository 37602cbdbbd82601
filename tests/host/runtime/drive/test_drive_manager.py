"""Which commands reach the board in each mode, and what ends a drive. The e2e tests use the real firmware."""

from collections.abc import Callable
from itertools import product
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from benchmarks.shared.telemetry import telemetry_sample

from thumper.board.messages import Command, Fault, State, Telemetry
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2, Twist2
from thumper.common.kinematics import DriveGeometry, WheelSpeeds
from thumper.config.manual_drive import ManualDriveOptions
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.local_model import NO_OBSTACLES, ObstaclePoints
from thumper.navigation.goal import Goal
from thumper.navigation.state import NavigationOutput, NavigationState, ScanFrames
from thumper.runtime.drive import drive_manager
from thumper.runtime.drive.assisted_teleop import AssistedCommand
from thumper.runtime.drive.drive_manager import (
    TURNING,
    UNKNOWN_GOAL,
    DriveManager,
    DriveMode,
)
from thumper.runtime.requests import TeleopSource, Velocity
from thumper.runtime.state_estimator import RobotState

GOAL, AHEAD, ZERO = Goal(x_m=2.0, y_m=0.0), Twist2(v_m_s=0.2), WheelSpeeds()
WHEEL_MAX_RAD_S = 13.0
ARM, DISARM, CLEAR, ESTOP = Command.ARM, Command.DISARM, Command.CLEAR_FAULT, Command.E_STOP
SOURCES = [
    (TeleopSource.VELOCITY, "driven by another program"),
    (TeleopSource.TELEOP, "driven by teleop"),
    (TeleopSource.GAMEPAD, "driven by gamepad"),
]
GRID = OccupancyGrid(cells=np.zeros((9, 9), np.int8), resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)


class Bench:
    """A drive manager, what it sends to the board, and the clock."""

    def __init__(self) -> None:
        self.sent: list[Any] = []
        self.now_s = 100.0
        self.age_s = 0.0  # of the telemetry
        self.stop_fails = False
        self.output = NavigationOutput(command=AHEAD, reason="on the way")
        self.plans: list[tuple[Any, ...]] = []
        self.goals: list[Goal] = []
        board = SimpleNamespace(
            command=self.sent.append,
            set_wheel_speeds=self.sent.append,
            emergency_stop=self._emergency_stop,
            now_s=lambda: self.now_s + self.age_s,
        )
        self.observed: list[tuple[DriveMode, bool]] = []  # and whether it is parked
        navigator = SimpleNamespace(
            set_goal=self.goals.append,
            update=self._plan,
            observe=lambda *_, parked, **__: self.observed.append((self.manager.mode, parked)),
            obstacles=NO_OBSTACLES,
        )
        self.manager: DriveManager = DriveManager(
            board=cast("Any", board),
            navigator=cast("Any", navigator),
            drive=DriveGeometry(),
            max_wheel_rad_s=WHEEL_MAX_RAD_S,
            options=ManualDriveOptions(),
        )

    def _emergency_stop(self) -> None:
        self.sent.append(ESTOP)
        if self.stop_fails:
            raise ThumperError("no answer")

    def _plan(self, *arguments: Any, **_: Any) -> NavigationOutput:
        self.plans.append(arguments)
        return self.output

    def step(self, cycles: int = 1, *, scan_age_s: float = 0.1, **telemetry: Any) -> NavigationOutput | None:
        """Run cycles; return the output of the last one."""
        output = None
        for _ in range(cycles):
            self.now_s += 0.1
            state = RobotState(
                time_s=self.now_s,
                map_from_base=Pose2(),
                twist=Twist2(),
                hits_in_map_m=np.empty((0, 2)),
                scan_age_s=scan_age_s,
                frames=ScanFrames(Pose2(), Pose2()),
            )
            output = self.manager.step(read(**telemetry), state, lambda: GRID)
        return output

    def take(self) -> list[Any]:
        """Return what was sent since the last call."""
        sent, self.sent[:] = list(self.sent), []
        return sent

    def hold(self, twist: Twist2, source: TeleopSource = TeleopSource.TELEOP) -> None:
        self.manager.add_manual_command(self.now_s, Velocity(channel=source, twist=twist))


def read(**values: Any) -> Telemetry:
    return telemetry_sample(
        0.0, **({"battery_mV": 7400, "left_speed": 500, "right_speed": 500} | values)
    ).telemetry


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    bench = Bench()
    monkeypatch.setattr(drive_manager, "time", SimpleNamespace(monotonic=lambda: bench.now_s))
    return bench


def wheels(v_m_s: float) -> WheelSpeeds:
    rad_s = v_m_s / DriveGeometry().wheel_radius_m
    return WheelSpeeds(left_rad_s=rad_s, right_rad_s=rad_s)


def test_idle_robot_sends_nothing(bench: Bench) -> None:
    assert bench.step(20, state=State.FAULT, fault=Fault.E_STOP) is None
    bench.manager.resend_command()
    bench.manager.stop("stop")
    assert bench.manager.outcome is None
    assert (bench.take(), bench.manager.mode, bench.manager.reason) == ([], DriveMode.IDLE, "")
    assert not (bench.manager.is_waiting)
    assert not (bench.manager.is_stop_unconfirmed)


@pytest.mark.parametrize(
    ("goal_x_m", "command", "reason", "remark"),
    [
        (0.2, AHEAD, "", ""),
        (0.2, Twist2(w_rad_s=1.0), "", TURNING),
        (0.2, Twist2(w_rad_s=1.0), "escaping", "escaping"),
        (2.0, AHEAD, "", UNKNOWN_GOAL),  # no scan has reached it
    ],
)
def test_the_remark_explains_the_motion(
    bench: Bench, goal_x_m: float, command: Twist2, reason: str, remark: str
) -> None:
    bench.manager.start(Goal(x_m=goal_x_m, y_m=0.0), None)
    bench.output = NavigationOutput(command=command, reason=reason)
    bench.step()
    assert bench.manager.remark == remark


def test_goal_arms_and_each_cycle_sends_what_the_navigator_wants(bench: Bench) -> None:
    bench.manager.start(GOAL, None)
    assert (bench.take(), bench.goals, bench.manager.mode) == ([ARM], [GOAL], DriveMode.DRIVING)
    assert bench.step() is bench.output
    assert bench.take() == [wheels(0.2)]
    assert (bench.manager.command, bench.manager.reason) == (AHEAD, "on the way")
    grid = bench.plans[0][3]
    assert grid.contains(*grid.cell_of(GOAL.x_m + 1.0, GOAL.y_m))  # the map includes the goal and 1 m more
    for x_m, y_m in product((-2.5, 2.5), repeat=2):  # and the controllers' window round the robot
        assert grid.contains(*grid.cell_of(x_m, y_m))
    bench.manager.resend_command()
    assert bench.take() == [wheels(0.2)]
    bench.manager.start(GOAL, None)  # replaces the goal, is armed already
    assert bench.take() == []


def test_obstacles_are_watched_in_each_cycle_in_which_something_else_may_drive(bench: Bench) -> None:
    bench.step()
    bench.manager.arm(None)
    bench.step()
    bench.hold(AHEAD)
    bench.step()
    holding = (DriveMode.HOLDING, False)
    assert bench.observed == [(DriveMode.IDLE, True), holding, holding]
    bench.now_s += 1.0  # the manual command has expired
    bench.manager.start(GOAL, None)
    bench.step(2)
    assert len(bench.observed) == 3, "the navigator does it itself"


def test_wheels_are_never_faster_than_the_motors_allow(bench: Bench) -> None:
    bench.output = NavigationOutput(command=Twist2(v_m_s=5.0))
    bench.manager.start(GOAL, None)
    bench.step()
    assert bench.take()[-1] == WheelSpeeds(left_rad_s=WHEEL_MAX_RAD_S, right_rad_s=WHEEL_MAX_RAD_S)


@pytest.mark.parametrize(
    ("state", "reached", "failed"),
    [(NavigationState.REACHED, True, False), (NavigationState.FAILED, False, True)],
)
def test_end_of_a_drive_brakes_then_disarms(
    bench: Bench, state: NavigationState, *, reached: bool, failed: bool
) -> None:
    bench.manager.start(GOAL, None)
    bench.output = NavigationOutput(state=state, reason="the end")
    bench.step()
    outcome = bench.manager.outcome
    assert outcome is not None
    assert (outcome.reached, outcome.navigation_failed, outcome.by_user) == (reached, failed, False)
    assert (outcome.reason, bench.manager.mode, bench.manager.goal) == ("the end", DriveMode.STOPPING, None)
    bench.take()
    bench.step(left_speed=0)  # one side still turns
    bench.step(right_speed=0)
    assert bench.take() == [ZERO, ZERO]
    bench.step(left_speed=0, right_speed=0)
    assert (bench.take(), bench.manager.mode, bench.manager.reason) == ([DISARM], DriveMode.IDLE, "the end")


def test_braking_ends_after_three_seconds_whatever_the_encoders_say(bench: Bench) -> None:
    bench.manager.start(GOAL, None)
    bench.step()
    bench.manager.stop("stop")
    bench.take()
    bench.step(31)
    assert bench.take() == [ZERO] * 30 + [DISARM]
    bench.manager.start(GOAL, None)
    bench.step()
    bench.manager.stop("again")
    bench.take()
    bench.step(30)
    assert bench.take() == [ZERO] * 30  # counted again


def test_stop_cancels_the_drive_for_the_user(bench: Bench) -> None:
    bench.manager.start(GOAL, None)
    bench.step()
    bench.manager.stop("cancelled")
    assert bench.manager.outcome == drive_manager.DriveOutcome(
        reached=False, reason="cancelled", by_user=True
    )
    bench.take()
    bench.manager.resend_command()
    assert bench.take() == [ZERO]


def test_fault_ends_the_drive_but_not_one_from_before_arming(bench: Bench) -> None:
    bench.manager.start(GOAL, None)
    assert bench.step(state=State.FAULT, fault=Fault.STALL_LEFT) is not None  # sent before ARM arrived
    assert bench.manager.mode.value == "driving"
    assert bench.step(state=State.FAULT, fault=Fault.STALL_LEFT) is None
    assert bench.manager.mode is DriveMode.IDLE
    outcome = bench.manager.outcome
    assert outcome is not None
    assert "the board stopped the motors" in outcome.reason
    assert not outcome.by_user
    bench.take()
    bench.step()
    assert not bench.take()
    bench.manager.start(GOAL, None)
    assert bench.step(state=State.FAULT, fault=Fault.STALL_LEFT) is not None  # each arming counts again


def test_four_disarmed_cycles_in_a_row_mean_another_program(bench: Bench) -> None:
    bench.manager.start(GOAL, None)
    for _ in range(3):
        bench.step(3, state=State.DISARMED)
        bench.step()
    assert bench.manager.mode is DriveMode.DRIVING
    bench.step(4, state=State.DISARMED)
    assert (bench.manager.mode, bench.manager.reason) == (
        DriveMode.IDLE,
        "another program disarmed the board",
    )
    bench.manager.start(GOAL, None)
    bench.step(3, state=State.DISARMED)
    assert bench.manager.mode.value == "driving"


@pytest.mark.parametrize(
    ("fault", "clear", "sent"),
    [
        (Fault.LINK_LOST, False, [CLEAR, ARM]),
        (Fault.E_STOP, True, [CLEAR, ARM]),
        (Fault.E_STOP, False, []),
        (Fault.STALL_RIGHT, False, []),
    ],
)
def test_latched_fault_is_cleared_on_request_only(
    bench: Bench, fault: Fault, sent: list[Command], *, clear: bool
) -> None:
    latched = read(state=State.FAULT, fault=fault)
    if sent:
        bench.manager.start(GOAL, latched, clear_fault=clear)
    else:
        with pytest.raises(ThumperError, match="latched a fault"):
            bench.manager.start(GOAL, latched)
        cure = r"loose\? Clear" if fault is Fault.STALL_RIGHT else "pressed; clear"
        with pytest.raises(ThumperError, match=f"latched a fault: .*{cure} the fault when"):
            bench.manager.arm(latched)
        assert (bench.manager.mode, bench.goals) == (DriveMode.IDLE, [])
    assert bench.take() == sent


def test_armed_robot_holds_zero_and_stays_armed_after_a_drive(bench: Bench) -> None:
    assert not bench.manager.holds_still
    bench.manager.arm(None)
    bench.step()
    assert bench.take() == [ARM, ZERO]
    assert (bench.manager.mode, bench.manager.reason) == (DriveMode.HOLDING, "armed")
    assert bench.manager.holds_still
    bench.manager.start(GOAL, None)
    bench.step()
    bench.manager.arm(None)  # during a drive: changes nothing now
    assert (bench.manager.mode, bench.take()) == (DriveMode.DRIVING, [wheels(0.2)])
    bench.output = NavigationOutput(state=NavigationState.REACHED)
    bench.step()
    assert bench.manager.mode.value == "holding"
    bench.take()
    bench.step()
    assert bench.take() == [ZERO]
    bench.manager.disarm("off")
    assert (bench.take(), bench.manager.mode, bench.manager.reason) == ([DISARM], DriveMode.IDLE, "off")
    bench.manager.start(GOAL, None)
    bench.step()
    assert bench.manager.mode is DriveMode.STOPPING  # disarming ended the manual arming
    bench.manager.start(GOAL, None)
    bench.manager.disarm("off")
    outcome = bench.manager.outcome
    assert outcome is not None
    assert outcome.by_user


def test_cruise_holds_a_speed_until_the_stop(bench: Bench) -> None:
    bench.manager.arm(None)
    bench.manager.cruise(AHEAD)
    bench.step()
    assert (bench.take(), bench.manager.command) == ([ARM, wheels(0.2)], AHEAD)
    assert not bench.manager.holds_still
    bench.manager.stop("stop")
    bench.step()
    assert bench.take() == [ZERO]
    bench.manager.arm(None)
    bench.take()
    bench.step()
    assert (bench.take(), bench.manager.command) == ([ZERO], Twist2())
    bench.manager.cruise(AHEAD)
    bench.manager.disarm("off")
    bench.manager.arm(None)
    bench.take()
    bench.step()
    assert bench.take() == [ZERO]


def test_emergency_stop_is_unconfirmed_until_the_board_answers(bench: Bench) -> None:
    bench.manager.start(GOAL, None)
    bench.step()
    bench.take()
    bench.stop_fails = True
    with pytest.raises(ThumperError):
        bench.manager.emergency_stop()
    assert (bench.take(), bench.manager.mode) == ([ESTOP], DriveMode.IDLE)
    assert bench.manager.is_stop_unconfirmed
    outcome = bench.manager.outcome
    assert outcome is not None
    assert outcome.by_user
    bench.step(3)
    bench.manager.resend_command()
    assert bench.take() == []  # silent: the board stops by its own time-out
    bench.stop_fails = False
    bench.manager.emergency_stop()
    assert not bench.manager.is_stop_unconfirmed


def test_clearing_the_fault_leaves_the_motors_off(bench: Bench) -> None:
    bench.manager.is_stop_unconfirmed = True
    bench.manager.clear_fault()
    assert (bench.take(), bench.manager.mode, bench.manager.reason) == (
        [CLEAR],
        DriveMode.IDLE,
        "fault cleared",
    )
    assert not bench.manager.is_stop_unconfirmed
    bench.manager.arm(None)
    bench.manager.clear_fault()
    assert bench.manager.reason == "armed"


def test_manual_command_needs_an_armed_robot(bench: Bench) -> None:
    bench.hold(AHEAD)
    bench.step()
    assert (bench.take(), bench.manager.mode) == ([], DriveMode.IDLE)
    assert bench.manager.reason == "the motors are off; arm the robot to drive it manually"
    bench.manager.arm(None)
    bench.step()
    assert bench.take() == [ARM, ZERO]  # the refused command does not start later


def test_manual_command_during_a_fault_keeps_the_reason_of_the_stop(bench: Bench) -> None:
    bench.manager.arm(None)
    bench.hold(AHEAD)
    bench.step(state=State.MANUAL)
    bench.manager.emergency_stop()
    bench.hold(AHEAD)  # the key is still down
    assert bench.manager.reason == "emergency stop"
    bench.step(state=State.MANUAL)  # sent before the board had the stop
    bench.hold(AHEAD)
    assert bench.manager.reason == "emergency stop"
    bench.step(state=State.FAULT, fault=Fault.E_STOP)
    bench.hold(AHEAD)
    assert bench.manager.reason == "emergency stop"
    bench.manager.clear_fault()
    bench.step(state=State.DISARMED)
    bench.hold(AHEAD)
    assert bench.manager.reason == "the motors are off; arm the robot to drive it manually"


def test_zero_from_a_stick_at_rest_is_no_complaint(bench: Bench) -> None:
    bench.hold(Twist2())
    assert bench.manager.reason == ""


@pytest.mark.parametrize(("source", "driver"), SOURCES)
def test_manual_command_is_a_speed_and_overrides_the_goal(
    bench: Bench, source: TeleopSource, driver: str
) -> None:
    bench.manager.start(GOAL, None)
    bench.step()
    bench.take()
    bench.hold(AHEAD, source)
    bench.step()
    assert bench.take() == [wheels(0.2)]
    outcome = bench.manager.outcome
    assert outcome is not None
    assert (outcome.by_user, outcome.reason) == (True, f"overridden: {driver}")
    assert (bench.manager.mode, bench.manager.command) == (DriveMode.MANUAL, AHEAD)
    bench.manager.resend_command()
    assert bench.take() == [wheels(0.2)]
    bench.now_s += 1.0  # without a new command
    bench.step()
    assert (bench.take(), bench.manager.mode) == ([ZERO], DriveMode.HOLDING)
    assert bench.manager.reason == "manual command released"
    bench.manager.start(GOAL, None)
    bench.output = NavigationOutput(state=NavigationState.REACHED)
    bench.step()
    assert bench.manager.mode is DriveMode.HOLDING  # who took over manually keeps the robot armed


def test_a_goal_takes_over_from_manual_driving_without_arming(bench: Bench) -> None:
    bench.manager.arm(None)
    bench.hold(AHEAD)
    bench.step()
    bench.take()
    bench.manager.mux.clear()
    bench.manager.start(GOAL, None)
    bench.step()
    assert (bench.take(), bench.manager.mode) == ([wheels(0.2)], DriveMode.DRIVING)


@pytest.mark.parametrize(
    ("asked", "driven"),
    [
        (Twist2(v_m_s=0.9), Twist2(v_m_s=0.5)),
        (Twist2(w_rad_s=-9.0), Twist2(w_rad_s=-1.5)),
        (Twist2(v_m_s=-1.0, w_rad_s=2.0), Twist2(v_m_s=-0.5, w_rad_s=1.0)),
        (Twist2(v_m_s=0.2, w_rad_s=3.0), Twist2(v_m_s=0.1, w_rad_s=1.5)),
        (Twist2(v_m_s=0.5, w_rad_s=1.5), Twist2(v_m_s=0.5, w_rad_s=1.5)),
    ],
)
def test_a_manual_command_beyond_the_limits_keeps_its_curvature(
    bench: Bench, asked: Twist2, driven: Twist2
) -> None:
    bench.manager._options = ManualDriveOptions(manual_v_max_m_s=0.5, manual_w_max_rad_s=1.5)
    bench.manager.arm(None)
    bench.hold(asked)
    bench.step()
    assert bench.manager.command == driven


def test_override_of_the_assistance_ends_unless_it_is_repeated(bench: Bench) -> None:
    standing = SimpleNamespace(limit=lambda *_: AssistedCommand(twist=Twist2(), reason="an obstacle ahead"))
    bench.manager._assisted_teleop = cast("Any", standing)
    bench.manager.arm(None)

    def driven() -> Twist2:
        bench.hold(AHEAD, TeleopSource.GAMEPAD)
        bench.step()
        return bench.manager.command

    assert driven() == Twist2()
    bench.manager.override_assistance(bench.now_s)
    assert [driven(), driven()] == [AHEAD, AHEAD]  # 0.1 s a cycle, 0.3 s an override
    bench.now_s += 0.05
    assert driven() == Twist2()


@pytest.mark.parametrize(("source", "driver"), SOURCES)
@pytest.mark.parametrize("obstacle", ["", "an obstacle ahead"])
def test_the_reason_names_what_the_assistance_stops_for(
    bench: Bench, source: TeleopSource, driver: str, obstacle: str
) -> None:
    assisted = SimpleNamespace(limit=lambda twist, *_: AssistedCommand(twist=twist, reason=obstacle))
    bench.manager._assisted_teleop = cast("Any", assisted)
    bench.manager.arm(None)
    bench.hold(AHEAD, source)
    bench.step()
    assert bench.manager.reason == (f"{driver}; {obstacle}" if obstacle else driver)


@pytest.mark.parametrize(("source", "points"), [(TeleopSource.VELOCITY, 1), (TeleopSource.TELEOP, 2)])
def test_unseen_ground_counts_unless_a_program_drives(
    bench: Bench, source: TeleopSource, points: int
) -> None:
    obstacles: list[ObstaclePoints] = []

    def limit(twist: Twist2, _state: Any, known: ObstaclePoints, _grid: Any) -> AssistedCommand:
        obstacles.append(known)
        return AssistedCommand(twist=twist)

    bench.manager._assisted_teleop = cast("Any", SimpleNamespace(limit=limit))
    bench.manager.navigator.obstacles = ObstaclePoints(np.ones((2, 2)), np.zeros(2), 1)  # type: ignore[misc]
    bench.manager.arm(None)
    bench.hold(AHEAD, source)
    bench.step()
    assert [len(known.points_m) for known in obstacles] == [points]


def test_the_activity_is_the_reason_or_the_task(bench: Bench) -> None:
    bench.output = NavigationOutput(command=AHEAD)
    bench.manager.start(GOAL, None, task="to the dock")
    bench.step()
    assert bench.manager.activity == "to the dock"
    bench.output = NavigationOutput(command=AHEAD, reason="on the way")
    bench.step()
    assert bench.manager.activity == "on the way"
    bench.manager.arm(None)
    bench.manager.stop("")
    assert bench.manager.activity == ""


def test_only_an_idle_robot_forgets_its_reason(bench: Bench) -> None:
    bench.manager.arm(None)
    bench.manager.forget_reason()
    assert bench.manager.reason == "armed"
    bench.manager.disarm("off")
    bench.manager.forget_reason()
    assert bench.manager.reason == ""


@pytest.mark.parametrize("source", TeleopSource)
def test_commands_that_go_on_do_not_prevent_a_stop(bench: Bench, source: TeleopSource) -> None:
    bench.manager.arm(None)
    bench.hold(AHEAD, source)
    bench.step()
    bench.manager.stop("cancelled")
    bench.take()
    bench.hold(AHEAD, source)
    bench.step()
    assert (bench.take(), bench.manager.reason) == ([ZERO], "cancelled")
    bench.hold(AHEAD, source)
    bench.step(left_speed=0, right_speed=0)
    assert (bench.take(), bench.manager.mode) == ([DISARM], DriveMode.IDLE)
    bench.manager.arm(None)
    bench.hold(AHEAD, source)
    bench.step()
    assert bench.manager.command == AHEAD  # armed again, it drives


def test_stop_of_manual_driving_brakes_at_once(bench: Bench) -> None:
    bench.manager.arm(None)
    bench.hold(AHEAD)
    bench.step()
    bench.take()
    bench.manager.stop("stop")
    bench.step()
    assert bench.take() == [ZERO]  # the command that was held is forgotten


def test_manual_command_ends_with_the_motors_off(bench: Bench) -> None:
    bench.manager.arm(None)
    bench.hold(AHEAD)
    bench.step()
    bench.manager.disarm("off")
    bench.take()
    bench.manager.resend_command()
    bench.manager.arm(None)
    bench.step()
    assert bench.take() == [ARM, ZERO]


def test_old_data_holds_the_robot_and_ends_the_drive(bench: Bench) -> None:
    bench.manager.start(GOAL, None)
    bench.step()
    bench.take()
    bench.plans.clear()
    assert bench.step(scan_age_s=0.5) is None
    assert not bench.plans
    assert (bench.take(), bench.manager.is_waiting, bench.manager.command) == ([ZERO], True, Twist2())
    assert "waiting for the lidar" in bench.manager.reason
    bench.manager.resend_command()
    assert bench.take() == [ZERO]
    assert bench.step() is not None  # recent again: it drives on
    assert (bench.take(), bench.manager.is_waiting) == ([wheels(0.2)], False)
    bench.step(scan_age_s=0.5)
    bench.manager.start(GOAL, None)
    assert not bench.manager.is_waiting
    bench.step(scan_age_s=1.5)
    outcome = bench.manager.outcome
    assert outcome is not None
    assert "lidar stopped" in outcome.reason
    assert not outcome.reached
    assert bench.manager.mode is DriveMode.STOPPING


def test_result_of_a_plan_that_took_too_long_is_not_driven(bench: Bench) -> None:
    bench.manager.start(GOAL, None)
    bench.step()
    bench.take()
    slow = bench.output

    def plan(*_: Any, **__: Any) -> NavigationOutput:
        bench.age_s = 0.5
        return slow

    bench.manager.navigator.update = plan  # type: ignore[method-assign]
    assert bench.step() is None
    assert bench.take() == [ZERO]
    assert "overloaded" in bench.manager.reason


def test_who_stops_the_robot_may_say_why(bench: Bench) -> None:
    bench.manager.on_stopped("tuned")
    bench.manager.on_stopped()
    assert bench.manager.reason == "tuned"


def test_abort_and_stopped_send_nothing(bench: Bench) -> None:
    ends: tuple[Callable[[], None], ...] = (lambda: bench.manager.abort("gone"), bench.manager.on_stopped)
    for end in ends:
        bench.manager.start(GOAL, None)
        bench.step()
        bench.take()
        end()
        bench.manager.resend_command()
        bench.step()
        outcome = bench.manager.outcome
        assert outcome is not None
        assert not outcome.by_user
        assert (bench.take(), bench.manager.mode) == ([], DriveMode.IDLE)
