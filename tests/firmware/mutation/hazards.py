"""For each hazard guarded by the firmware: without the guard, the test that the safety case names fails.

python -m tests.firmware.mutation.hazards              all, on demand (a copy of the repository for each)
python -m tests.firmware.mutation.hazards --only TEXT  hazards that contain it

run.py changes every place of the firmware; this goes through docs/explanation/safety.md.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import NamedTuple

from tests.firmware.board.boot import ROOT
from tests.meta import hazard_tables

BUILT = (
    "hil/thumper_hil/chip/native/build",
    "host/thumper/kernels",
    "hil/thumper_hil/kernels",
    "tuning/thumper_tuning/kernels",
)
"""Folders that git ignores and a copy needs: to compile the kernels again takes a robot over a minute."""
INTERFACE, MAIN, MISSION = (
    "core/host_interface.hpp",
    "app/main.cpp",
    "tests/hil/faults/test_faults_mission.py::test_robot_stops_in_time_and_reports_the_cause",
)


class Removal(NamedTuple):
    """A file of the firmware, a text of it, the text without the guard, and which of the tests to run."""

    file: str
    old: str
    new: str
    test: str  # the end of a test that the row names; "-k" may follow


LINK = ("if (silence_ms_ >= kLinkTimeout_ms) Trip(Fault::kLinkLost);", "")
ACCELEROMETER = ("adc.TakeAxes(&axes)) host.UpdateAcceleration(axes);", "adc.TakeAxes(&axes)) axes[0] = 0;")
STALL = ("if (verdict == WheelMonitor::Verdict::kStall) Trip(stall);", "(void)stall;")
OVER_CURRENT = (
    "if (current_monitor_.Step(left_mA, right_mA, limit_mA)) Trip(Fault::kOverCurrent);",
    "current_monitor_.Step(left_mA, right_mA, limit_mA);",
)
HAZARDS: dict[str, Removal] = {
    "somebody steps close before the moving robot": Removal(
        "core/ramp.hpp",
        "    step = uint16_t(steps.slow_down);\n",
        "",
        "test_it_stops_in_less_way_than_it_speeds_up",
    ),
    "the robot runs into something that no sensor saw": Removal(
        MAIN, "host.UpdateInputs(pins::ReadInputs());", "", "test_a_switch_stops_the_motors_within_a_tick"
    ),
    "the robot runs into something and no switch touches it": Removal(
        MAIN, *ACCELEROMETER, "test_a_collision_stops_the_motors"
    ),
    "the robot falls on its side, or somebody lifts it while it drives": Removal(
        MAIN, *ACCELEROMETER, "test_a_robot_on_its_side_stops_after_300_ms"
    ),
    "the operator presses a button at an input of the board": Removal(
        INTERFACE,
        "AckStatus::kOk && input_active_ ?",
        "AckStatus::kOk && false ?",
        "test_nothing_arms_or_clears_while_an_input_is_active",
    ),
    "the operator presses the emergency stop": Removal(
        "core/supervisor.hpp",
        "    return Take(event, Fault::kEStop);\n",
        "    return event == Event::kEStop ? AckStatus::kOk : Take(event, Fault::kEStop);\n",
        "test_an_emergency_stop_latches_until_cleared",
    ),
    "a program that set motor PWM is silent, but wheel speeds still arrive": Removal(
        INTERFACE,
        "if (supervisor_.state() == State::kClosedLoop) Drive(",
        "silence_ms_ = 0;\n        if (supervisor_.state() == State::kClosedLoop) Drive(",
        "test_wheel_speeds_do_not_keep_motor_pwm_alive",
    ),
    "the robot's program is killed": Removal(INTERFACE, *LINK, "test_robot_process_killed"),
    "the robot's program hangs": Removal(INTERFACE, *LINK, "test_robot_process_hangs"),
    "the computer is suspended for seconds": Removal(
        INTERFACE, *LINK, "test_suspended_computer_does_not_drive_on"
    ),
    "the computer is too slow for the control loop": Removal(
        INTERFACE, *LINK, "test_a_host_that_is_too_slow_loses_the_link"
    ),
    "the board's cable is cut": Removal(INTERFACE, *LINK, "test_serial_cut"),
    "noise on the line": Removal(
        "core/framing.hpp", " && crc == kFrameResidue", "", "test_every_single_bit_flip_is_refused"
    ),
    "arbitrary bytes": Removal(
        "core/framing.hpp",
        "if (length_ < sizeof(body_)) {",
        "if (true) {",
        "test_no_bytes_break_the_firmware",
    ),
    "a flood of requests": Removal(
        MAIN,
        "for (uint8_t left = 64; left != 0 && uart.Get(&byte); --left) {",
        "while (uart.Get(&byte)) {",
        "test_a_host_that_never_pauses_keeps_neither_time_out_nor_watchdog_away",
    ),
    "encoder wire cut; motor dead": Removal(INTERFACE, *STALL, f"{MISSION} -k encoder.left.b"),
    "encoder or motor wires exchanged: the loop would run away": Removal(
        INTERFACE,
        "if (verdict == WheelMonitor::Verdict::kReversed) Trip(reversed);",
        "(void)reversed;",
        "test_a_wheel_that_keeps_counting_the_wrong_way_is_reversed",
    ),
    "exchanged wires, in a slow turn on the spot, while the scrub of the tyres holds the wheel": Removal(
        INTERFACE,
        "Magnitude(current_mA) * (kMaxPwm * 4 / 3) >= int32_t(2) * stall_2mA * Magnitude(wheel.pwm);",
        "(static_cast<void>(current_mA), true);",
        "test_a_dead_encoder_is_still_found",
    ),
    "wheel blocked: the motor burns": Removal(INTERFACE, *OVER_CURRENT, f"{MISSION} -k wheels.right"),
    "encoder signal disturbed": Removal(
        INTERFACE,
        "if (edge_monitor_.Step(samples_.lost_edges)) Trip(Fault::kLostEdges);",
        "",
        "test_lost_edges_stop_the_motors",
    ),
    "short in a motor": Removal(INTERFACE, *OVER_CURRENT, "test_shorted_motor_causes_over_current"),
    "battery empty: a LiPo is ruined": Removal(
        INTERFACE,
        "    if (fault != Fault::kNone) Trip(fault);\n    return fault == Fault::kLowBattery;",
        "    return fault == Fault::kLowBattery;",
        "test_low_battery_stops_and_holds_until_charged",
    ),
    "analogue converter stops: empty battery and over-current go unnoticed": Removal(
        MAIN,
        "if (adc.stopped()) host.LoseAnalogReadings();",
        "",
        "test_a_stopped_converter_stops_the_motors",
    ),
    "wrong battery, or its divider broken: low battery goes unnoticed": Removal(
        "core/battery.hpp",
        "    if (high_) return Fault::kHighBattery;\n",
        "",
        "test_a_battery_that_reads_too_high_stops_the_motors",
    ),
    "directions or dimensions of another robot are set": Removal(
        INTERFACE,
        "if (supervisor_.armed() && index >= kFirstRobotParameter) return AckStatus::kArmed;",
        "",
        "test_a_parameter_of_the_robot_changes_only_with_the_motors_off",
    ),
    "an interrupt at a bad moment tears a command or a measurement": Removal(
        MAIN, "} while (ticks != 0);", "} while (false);", "tears_nothing -k telemetry_is_whole-tick"
    ),
    "firmware hangs, interrupts on": Removal(
        MAIN, "  watchdog::Start();\n", "", "test_a_hang_with_interrupts_on_is_recovered"
    ),
    "firmware hangs, interrupts off": Removal(
        "board/watchdog.hpp",
        "WDTCSR = 1 << WDIE | 1 << WDE | 1 << WDP2;",
        "WDTCSR = 1 << WDIE | 1 << WDP2;",
        "test_a_hang_with_interrupts_off_ends_safe_but_dead",
    ),
    "its millisecond timer stops, and the time-out with it": Removal(
        MAIN,
        "if (clock_runs) watchdog::Kick();",
        "if (clock_runs || true) watchdog::Kick();",
        "test_a_dead_millisecond_timer_is_noticed",
    ),
    "board reset while driving": Removal(
        "core/supervisor.hpp",
        "State state_ = State::kDisarmed;",
        "State state_ = State::kClosedLoop;",
        "test_reset_while_driving_disarms_the_robot",
    ),
    "a reset clears a fault by accident": Removal(
        MAIN,
        "  reset::Keep(host.supervisor().fault());\n",
        "",
        "test_a_latched_fault_outlasts_a_reset",
    ),
    "a state without a reaction to a fault": Removal(
        "core/supervisor.hpp",
        "static_assert(Complete(MakeTransitions()),",
        "static_assert(Complete(MakeTransitions()) || true,",
        "test_a_spoilt_table_does_not_compile",
    ),
    "power fails while gains are saved": Removal(
        "core/store.hpp",
        "    next_slot_ ^= 1;\n",
        "",
        "test_a_cut_in_a_later_save_leaves_the_old_set_or_the_new",
    ),
    "extreme gains or parameters": Removal(
        "core/parameters.hpp",
        "      return AckStatus::kOutOfRange;\n",
        "",
        "test_parameters_start_at_their_default_and_keep_their_range",
    ),
    "a motor is reversed at speed": Removal(
        "board/motors.hpp",
        "      left_rest_ = kRest;\n",
        "      left_rest_ = 1;\n",
        "test_a_turning_motor_rests_first",
    ),
    "a drive by motor PWM ends at speed: the wheels roll on or swing back": Removal(
        "core/drive.hpp",
        "    controller_.TrackSpeed(speed);\n",
        "",
        "test_a_rolling_wheel_that_is_taken_over_neither_rolls_on_nor_swings_back",
    ),
}


NOT_OF_THE_FIRMWARE = frozenset(
    {
        "obstacle in the path",
        "many small steps toward an obstacle",
        "somebody walks into the path",
        "hard braking tilts the base, and the lidar sees the floor",
        "lidar silent or unplugged: driving blind",
        "an obstacle behind the robot that the lidar never saw",
        "a chair leg beside the tail of a robot that turns on the spot",
        "a dark chair leg gives no return in some scans",
        "lost returns look like people who come and go",
        "wheels slip: odometry is wrong",
        "a goal in a wall that the map shows",
        "the pose jitters or jumps while an obstacle is beside the tail, out of view",
        "somebody who walks past puts a foot down beside the tail, out of view",
        "a pane of glass converges with the way; each scan shows a short piece of it beside the robot",
        "`thumper stop` while a program repeats its velocity command",
        "the emergency stop's frame is lost on a bad line",
        "the emergency stop is sent in a flood of other commands",
        "the dashboard that drives manually is frozen, closed, or its network cut",
        "the operator presses the emergency stop of a dashboard without a connection",
        "the operator presses it just after the network was cut, before the page notices",
        "the dashboard that started an experiment is gone: nobody watches the lane",
        "the operator drives or backs into a wall",
        "gamepad unplugged, its program killed",
        "the operator presses a stop between two drives of a script",
        "navigation competes with manual driving",
        "Ctrl-C, and Ctrl-C again",
        "a stranger on the network",
        "malformed messages from dashboard or bus",
        "the program gets only a quarter or a twentieth of a core",
        "the computer's clock jumps by a day",
        "a part of the program fails",
        "the centre of rotation moves while the robot turns, so the base shifts sideways",
        "an error in a user's script",
        "firmware of another protocol version",
        "tests on a real board with wheels on the ground",
    }
)
"""Hazards that the robot's program or the operator guards."""


def hazards_of_the_safety_case() -> list[str]:
    """Return the hazards of all its sections, in order."""
    return [*hazard_tables.hazards("safety").values()]


def named_tests(hazard: str) -> list[str]:
    """Return the tests that the safety case names for a hazard."""
    number = next(number for number, text in hazard_tables.hazards("safety").items() if text == hazard)
    return hazard_tables.named_tests("safety")[number]


def chosen_test(hazard: str) -> list[str]:
    """Return pytest's arguments for a hazard; raise StopIteration if its row does not name the test."""
    name, *selection = HAZARDS[hazard].test.split()
    return [next(test for test in named_tests(hazard) if test.endswith(name)), *selection]


def without(removal: Removal, text: str) -> str:
    """Return a file's text without the guard; raise ValueError if the guard is not there once."""
    if text.count(removal.old) != 1:
        raise ValueError(f"{removal.file}: {removal.old.strip()!r} must occur once; update hazards.py")
    return text.replace(removal.old, removal.new)


def outcome(removal: Removal | None, test: tuple[str, ...]) -> int:
    """Return pytest's exit code in a copy of the repository without the guard (None: unchanged)."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True)
    with tempfile.TemporaryDirectory() as name:
        copy = Path(name)
        for file in listed.stdout.splitlines():
            (copy / file).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / file, copy / file, follow_symlinks=False)
        for built in BUILT:
            if (ROOT / built).exists():
                shutil.copytree(ROOT / built, copy / built)
        if removal:
            path = copy / "firmware" / removal.file
            path.write_text(without(removal, path.read_text(encoding="utf-8")), encoding="utf-8")
        for board in ("trex", "nano"):
            subprocess.run(
                ["make", "-s", "-C", copy / "firmware", f"BOARD={board}"], check=True, capture_output=True
            )
        folders = [str(copy / folder) for folder in ("host", "hil", "tuning", "")]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(folders)}
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:xdist", "-p", "no:cacheprovider"]
        done = subprocess.run([*command, *test], env=environment, cwd=copy, capture_output=True, check=False)
        return done.returncode


@cache
def require_pass_unchanged(test: tuple[str, ...]) -> None:
    """Raise SystemExit if the test fails in an unchanged copy: then its failure shows nothing."""
    if code := outcome(None, test):
        raise SystemExit(f"{' '.join(test)} fails in an unchanged copy (pytest: {code}); fix that first")


def is_noticed(hazard: str) -> bool:
    """Return whether the test fails in a copy without the guard; it must pass in an unchanged one."""
    test = tuple(chosen_test(hazard))
    require_pass_unchanged(test)
    return outcome(HAZARDS[hazard], test) == 1


def main() -> int:
    """Print each hazard; return 1 if a test passes without the guard."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", default="", help="hazards that contain this text")
    missed = 0
    for hazard in HAZARDS:
        if parser.parse_args().only in hazard:
            noticed = is_noticed(hazard)
            missed += not noticed
            print(f"{'noticed' if noticed else 'MISSED'}: {hazard}", flush=True)
    print(f"{missed} missed")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
