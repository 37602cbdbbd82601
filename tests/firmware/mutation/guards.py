"""Removes each guard of firmware/app and firmware/board in turn and reports whether a test notices.

python -m tests.firmware.mutation.guards               all of them, with the tests that can notice
python -m tests.firmware.mutation.guards --only NAME   one guard
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from tests.firmware.board.boot import ROOT

FIRMWARE = ROOT / "firmware"
TESTS = Path(__file__).resolve().parents[1]


@dataclass(frozen=True, slots=True, kw_only=True)
class Guard:
    """A guard, the text without it, and the test file that must notice."""

    file: str
    old: str
    new: str
    test: str  # relative to tests/firmware; "-k" may follow
    equivalent: str = ""  # why its absence changes nothing
    accepted: str = ""  # why no test notices its absence, although it changes something


GUARDS: dict[str, Guard] = {
    "motor pins low before they are outputs": Guard(
        file="board/motors.hpp",
        old="  PORTD &= static_cast<uint8_t>(~pins::kLeftOutputs);  // after a restart",
        new="  //",
        test="board/test_bootloader.py",
    ),
    "direction forward at the start": Guard(
        file="board/motors.hpp",
        old="  PORTB |= pins::kRightForward;\n  DDRD",
        new="  DDRD",
        test="board/test_guards.py",
    ),
    "halt disconnects the timer": Guard(
        file="board/motors.hpp",
        old="inline void Halt() {\n  TCCR2A = 0;\n",
        new="inline void Halt() {\n",
        test="board/test_bootloader.py",
    ),
    "watchdog interrupt halts the motors": Guard(
        file="app/main.cpp",
        old="  motors::Halt();\n",
        new="",
        test="board/test_bootloader.py",
    ),
    "motors off at once": Guard(
        file="app/main.cpp", old=" drive.Off();", new=" {}", test="board/test_guards.py"
    ),
    "rest of the left motor": Guard(
        file="board/motors.hpp",
        old="      left_rest_ = kRest;\n",
        new="      left_rest_ = 1;\n",
        test="board/test_reversal.py",
    ),
    "pin low while the direction changes": Guard(
        file="board/motors.hpp",
        old="      TCCR2A &= static_cast<uint8_t>(~(1 << COM2B1));\n",
        new="",
        test="board/test_reversal.py",
    ),
    "rest after a tone": Guard(
        file="board/motors.hpp",
        old="left_rest_ = right_rest_ = kRest;",
        new="left_rest_ = right_rest_ = 1;",
        test="board/test_reversal.py",
    ),
    "no pin to the timer during a tone": Guard(
        file="board/beeper.hpp",
        old="      on ? drive_.Disconnect() : drive_.Reconnect();\n",
        new="",
        test="board/test_reversal.py",
    ),
    "pull-ups of the left encoder": Guard(
        file="board/encoders.hpp", old="  PORTD |= pins::kLeftEncoder;", new="  ", test="board/test_guards.py"
    ),
    "pull-ups of the right encoder": Guard(
        file="board/encoders.hpp",
        old="  PORTB |= pins::kRightEncoder;",
        new="  ",
        test="board/test_guards.py",
    ),
    "pull-ups of the protecting inputs": Guard(
        file="board/trex.hpp",
        old="  PORTD |= 1 << PD7;\n  PORTB |= 1 << PB0;\n",
        new="",
        test="board/test_inputs.py",
    ),
    "protecting inputs": Guard(
        file="app/main.cpp",
        old="      host.UpdateInputs(pins::ReadInputs());\n",
        new="",
        test="board/test_inputs.py",
    ),
    "readings of the accelerometer": Guard(
        file="app/main.cpp",
        old="if (pins::kHasAccelerometer && adc.TakeAxes(&axes)) host.UpdateAcceleration(axes);",
        new="(void)axes;",
        test="board/test_accelerometer.py",
    ),
    "an axis is no motor current": Guard(
        file="board/adc.hpp",
        old="    if (on_axis_) {",
        new="    if (on_axis_ && false) {",
        test="board/test_accelerometer.py",
    ),
    "z unknown while the accelerometer is off": Guard(
        file="board/adc.hpp",
        old="      axes_[2] = 0;  // unknown",
        new="      // unknown",
        test="board/test_accelerometer.py",
    ),
    "x first when the accelerometer is used again": Guard(
        file="board/adc.hpp",
        old="      axis_ = 0;\n      axes_[2]",
        new="      axes_[2]",
        test="board/test_accelerometer.py",
    ),
    "start level of the left encoder": Guard(
        file="app/main.cpp", old="  left_encoder.Reset(PIND);\n", new="", test="board/test_guards.py"
    ),
    "start level of the right encoder": Guard(
        file="app/main.cpp", old="  right_encoder.Reset(PINB);\n", new="", test="board/test_guards.py"
    ),
    "finished conversions only": Guard(
        file="board/adc.hpp",
        old="if ((ADCSRA & 1 << ADIF) == 0) {",
        new="if (false) {",
        test="board/test_guards.py -k converter",
    ),
    "power-on forgets the latched fault": Guard(
        file="board/reset.cpp",
        old=" && (flags & 1 << PORF) == 0;",
        new=";",
        test="board/test_guards.py",
    ),
    "reset flags are cleared": Guard(
        file="board/reset.cpp", old="  MCUSR = 0;\n", new="", test="board/test_guards.py"
    ),
    "power-on outranks brown-out": Guard(
        file="board/reset.cpp",
        old="  if ((flags & 1 << PORF) != 0) return fw::ResetCause::kPowerOn;",
        new="  ",
        test="board/test_guards.py",
    ),
    "latched fault survives": Guard(
        file="app/main.cpp",
        old="  reset::Keep(host.supervisor().fault());\n",
        new="",
        test="board/test_bootloader.py",
    ),
    "milliseconds for the watchdog": Guard(
        file="app/main.cpp",
        old="if (clock_runs) watchdog::Kick();",
        new="if (clock_runs || true) watchdog::Kick();",
        test="board/test_bootloader.py",
    ),
    "watchdog": Guard(
        file="app/main.cpp", old="  watchdog::Start();\n", new="", test="board/test_bootloader.py"
    ),
    "bounded reading of requests": Guard(
        file="app/main.cpp",
        old="for (uint8_t left = 64; left != 0 && uart.Get(&byte); --left) {",
        new="while (uart.Get(&byte)) {",
        test="board/test_link_noise.py",
    ),
    "frequency of the PWM": Guard(
        file="app/main.cpp",
        old="  motors::SetFrequency(robot.Get(fw::Parameter::kPwmFrequency));",
        new="  ",
        test="board/test_robot_parameters.py -k frequency",
    ),
    "repeat of a copy that a tick interrupted": Guard(
        file="app/main.cpp",
        old="} while (ticks != 0);",
        new="} while (false);",
        test="preemption/test_preemption.py -k telemetry_is_whole-tick",
    ),
    "atomic command": Guard(
        file="app/main.cpp",
        old="ATOMIC_BLOCK(ATOMIC_FORCEON) {  // only these three stores",
        new="{  //",
        test="preemption/test_preemption.py -k command_is_whole-tick",
    ),
    "hold of the tick": Guard(
        file="app/main.cpp",
        old="tick::Hold();",
        new="",
        test="preemption/test_preemption.py -k reversal_rests-tick",
    ),
    "counts read with interrupts off": Guard(
        file="app/main.cpp",
        old="  cli();\n  const uint16_t left_count",
        new="  const uint16_t left_count",
        test="board/test_guards.py -k tears_no_count",
    ),
    "watchdog off at the start": Guard(
        file="board/reset.cpp",
        old="  wdt_disable();\n",
        new="",
        test="board/test_bootloader.py",
        equivalent="the program sets the watchdog within 1 ms, before its 16 ms are over",
    ),
    "restart reported once": Guard(
        file="board/reset.cpp", old="  mark = 0;\n", new="", test="board/test_bootloader.py"
    ),
    "latched fault of this schema only": Guard(
        file="board/reset.cpp",
        old="fault < fw::kFaultCount && ",
        new="",
        test="board/test_guards.py",
    ),
    "no rest ends during a tone": Guard(
        file="app/main.cpp",
        old="if (!beeper.sounding()) drive.AfterMillisecond();",
        new="drive.AfterMillisecond();",
        test="board/test_reversal.py",
    ),
    "tone ends when armed": Guard(
        file="app/main.cpp",
        old="  if (host.supervisor().armed()) beeper.Sound(false);  // before a tick may drive\n",
        new="",
        test="board/test_reversal.py",
        accepted="it ends 1 ms later, because the robot is not quiet any more; only a charged battery arms",
    ),
    "atomic switch of the tone": Guard(
        file="board/beeper.hpp",
        old="    ATOMIC_BLOCK(ATOMIC_FORCEON) {\n      sounding_",
        new="    {\n      sounding_",
        test="preemption/test_preemption.py -k tone_leaves",
    ),
    "rest of the right motor": Guard(
        file="board/motors.hpp",
        old="      right_rest_ = kRest;\n",
        new="      right_rest_ = 1;\n",
        test="board/test_reversal.py",
    ),
    "right pin low while the direction changes": Guard(
        file="board/motors.hpp",
        old="      TCCR2A &= static_cast<uint8_t>(~(1 << COM2A1));\n",
        new="",
        test="board/test_reversal.py",
    ),
    "atomic count of ticks": Guard(
        file="app/main.cpp",
        old="    ATOMIC_BLOCK(ATOMIC_FORCEON) {\n      taken",
        new="    {\n      taken",
        test="preemption/test_preemption.py -k telemetry_is_whole-tick",
    ),
    "atomic start of a transmission": Guard(
        file="board/uart.hpp",
        old="    ATOMIC_BLOCK(ATOMIC_FORCEON) {\n      tx_head_",
        new="    {\n      tx_head_",
        test="preemption/test_preemption.py -k telemetry_is_whole-tick",
    ),
    "atomic write to the EEPROM": Guard(
        file="board/eeprom.hpp",
        old="    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {",
        new="    {",
        test="board/test_power_cut.py -k edges",
    ),
    "interrupts off before the sleep": Guard(
        file="app/main.cpp",
        old="  cli();\n  if (ticks == 0",
        new="  if (ticks == 0",
        test="preemption/test_preemption.py -k tears_nothing",
        accepted="the next millisecond wakes it",
    ),
    "hanging conversion ends": Guard(
        file="board/adc.hpp",
        old="      ADCSRA = 0;  // ends",
        new="      // ends",
        test="board/test_guards.py -k converter",
        accepted="the simulated converter does not hang, it only gives no result",
    ),
    "transfers that hang are given up": Guard(
        file="board/mpu6050.hpp",
        old="      Miss();  // no progress\n",
        new="",
        test="board/test_gyroscope.py",
    ),
    "clock pulses free the data line": Guard(
        file="board/mpu6050.hpp",
        old="DDRC ^= 1 << PC5;",
        new="{}",
        test="board/test_gyroscope.py",
    ),
    "nine clock pulses": Guard(
        file="board/mpu6050.hpp",
        old="kPulses = 9;",
        new="kPulses = 8;",
        test="board/test_gyroscope.py",
    ),
    "gap in the heading of at least a tick": Guard(
        file="board/mpu6050.hpp",
        old="kRetry_ms = 200, kSettle_ms = 50",
        new="kRetry_ms = 20, kSettle_ms = 5",
        test="board/test_gyroscope.py",
    ),
    "identity of the gyroscope": Guard(
        file="board/mpu6050.hpp",
        old="      Miss();  // another device has this address\n",
        new="      ++phase_;\n",
        test="board/test_gyroscope.py",
    ),
    "gyroscope that freezes": Guard(
        file="board/mpu6050.hpp",
        old="      if (!heading_.Measure(rate, stationary)) {",
        new="      if (!heading_.Measure(rate, stationary) && false) {",
        test="board/test_gyroscope.py",
    ),
    "no sleep while a transfer waits": Guard(
        file="app/main.cpp",
        old=" && !gyroscope.due()",
        new=" && (true || gyroscope.due())",
        test="board/test_gyroscope.py",
        accepted="the next millisecond wakes the main loop",
    ),
    "clock line released after a gap": Guard(
        file="board/mpu6050.hpp",
        old="    DDRC &= static_cast<uint8_t>(~(1 << PC5));\n",
        new="",
        test="board/test_gyroscope.py",
    ),
    "directions before the motors are driven": Guard(
        file="app/main.cpp",
        old="      if (host.supervisor().armed() && host.TakeChange()) Configure(host);",
        new="",
        test="board/test_configure_first.py",
    ),
    "constants complete before the tick reads them": Guard(
        file="app/main.cpp",
        old='  __asm__ volatile("" ::: "memory");  // complete before',
        new="  // complete before",
        test="preemption/test_preemption.py -k tears_nothing",
        equivalent="this compiler keeps the order without it",
    ),
}


def build(guard: Guard | None, folder: Path) -> None:
    """Build the firmware without a guard (None: unchanged) into `folder`."""
    copy = folder / "firmware"
    shutil.copytree(FIRMWARE, copy, ignore=shutil.ignore_patterns("build"))
    if guard:
        path = copy / guard.file
        text = path.read_text(encoding="utf-8")
        if text.count(guard.old) != 1:
            raise SystemExit(f"{guard.file}: {guard.old.strip()!r} must occur once; update guards.py")
        path.write_text(text.replace(guard.old, guard.new), encoding="utf-8")
    for board in ("trex", "nano"):
        command = ["make", "-s", "-C", str(copy), f"BOARD={board}"]
        subprocess.run(command, check=True, capture_output=True)


def outcome(guard: Guard | None, test: str) -> int:
    """Return pytest's exit code without the guard (None: with an unchanged copy)."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        build(guard, folder)
        file, *selection = test.split()
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:xdist", "-p", "no:cacheprovider"]
        environment = os.environ | {"THUMPER_FIRMWARE": str(folder / "firmware" / "build")}
        command += [str(TESTS / file), *selection]
        done = subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, check=False)
        return done.returncode


@cache
def require_pass_unchanged(test: str) -> None:
    """Raise SystemExit if the test fails with an unchanged copy: then its failure shows nothing."""
    if code := outcome(None, test):
        raise SystemExit(f"{test} fails on the unchanged firmware (pytest: {code}); fix that first")


def is_noticed(guard: Guard) -> bool:
    """Return whether the test fails without the guard; it must pass with it."""
    require_pass_unchanged(guard.test)
    return outcome(guard, guard.test) == 1


def main() -> int:
    """Print each guard; return 1 if one is noticed or not other than listed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", choices=GUARDS, nargs="+", default=list(GUARDS))
    results, wrong = Counter[str](), 0
    for name in parser.parse_args().only:
        guard, noticed = GUARDS[name], is_noticed(GUARDS[name])
        reason = guard.equivalent or guard.accepted
        result = (
            "noticed"
            if noticed
            else "equivalent"
            if guard.equivalent
            else "accepted"
            if reason
            else "NOT NOTICED"
        )
        results[result] += 1
        wrong += noticed == bool(reason)
        print(f"{result}: {name}{reason and f' ({reason})'}", flush=True)
    print(", ".join(f"{number} {result}" for result, number in results.items()) + f"; {wrong} not as listed")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
