"""From measurements to verdicts. Pure: no port, no clock."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.doctor.check import Check, worst_of

CABLE = "try another cable and USB port, keep motor wires away from it, close other programs"
SLOW = "something holds the bytes back: a network, a hub, or a busy computer; connect it directly"

QUESTIONS = 50
ANSWER_TIMEOUT_S = 1.0  # far beyond what may pass, so that a slow link is measured and not called lost
ENOUGH_SILENCE = 5  # questions in a row without an answer

BOARD_ROUND_TRIP_WARN_S, BOARD_ROUND_TRIP_FAIL_S = 0.04, 0.15  # half the board's own time-out
LIDAR_ROUND_TRIP_WARN_S, LIDAR_ROUND_TRIP_FAIL_S = 0.1, 0.3  # a turn; where the driver gives up asking
RATE_WARN_SHARE, RATE_FAIL_SHARE = 0.03, 0.1
LOSS_FAIL_SHARE = 0.02
BOARD_JITTER_WARN_S, BOARD_JITTER_FAIL_S = 0.02, 0.15
LIDAR_JITTER_WARN_S, LIDAR_JITTER_FAIL_S = 0.02, 0.1
BATTERY_ARM_V, BATTERY_WARN_V = 7.0, 7.2
SURE_COUNTS = 20
OTHER_SHARE = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Stream:
    """What came over a link while it was watched."""

    times_s: FloatArray  # when the device took each message, on the host's clock, shape (n,)
    arrivals_s: FloatArray  # when the host had it, shape (n,)
    expected_Hz: float
    damaged: int  # frames that did not check, both ways


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """From which jitter [s] on a link is doubtful, and bad."""

    warn_s: float
    fail_s: float


def measure_round_trips(ask: Callable[[int, float], float | None]) -> tuple[list[float], int]:
    """Ask QUESTIONS times, less if nobody answers; returns the answers' times [s] and how many did not come.

    `ask(number, timeout_s)` returns the time [s] from question to answer, None without one.
    """
    trips_s: list[float] = []
    lost = in_a_row = 0
    for number in range(QUESTIONS):
        trip_s = ask(number, ANSWER_TIMEOUT_S)
        if trip_s is not None:
            trips_s.append(trip_s)
            in_a_row = 0
            continue
        lost, in_a_row = lost + 1, in_a_row + 1
        if in_a_row == ENOUGH_SILENCE:
            break
    return trips_s, lost


def judge_round_trip(name: str, trips_s: list[float], lost: int, warn_s: float, fail_s: float) -> Check:
    """Judge the times from question to answer, and the questions without one."""
    if not trips_s:
        return Check(verdict="fail", what=f"{name}: no question was answered", cure=CABLE)
    asked = len(trips_s) + lost
    median_ms, most_ms = 1e3 * float(np.median(trips_s)), 1e3 * max(trips_s)
    late = worst_of(most_ms > 1e3 * warn_s, median_ms > 1e3 * fail_s)
    gone = worst_of(lost > 0, lost / asked > LOSS_FAIL_SHARE)
    verdict = worst_of(late != "pass" or gone != "pass", "fail" in {late, gone})
    what = f"{name}: round trip {median_ms:.1f} ms, at most {most_ms:.1f} ms, "
    what += f"jitter {1e3 * float(np.std(trips_s)):.1f} ms; {lost} of {asked} questions without answer"
    return Check(verdict=verdict, what=what, cure=CABLE if gone != "pass" else SLOW if late != "pass" else "")


def judge_stream(name: str, stream: Stream, jitter: Limits) -> list[Check]:
    """Judge rate, loss and jitter of a stream."""
    if stream.times_s.size < 3:
        return [Check(verdict="fail", what=f"{name}: nothing comes", cure=CABLE)]
    period_s = 1.0 / stream.expected_Hz
    steps = np.maximum(np.rint(np.diff(stream.times_s) / period_s), 1.0)
    lost = int(steps.sum()) - steps.size
    rate_Hz = float(steps.sum() / (stream.times_s[-1] - stream.times_s[0]))
    off = abs(rate_Hz / stream.expected_Hz - 1.0)
    rate = worst_of(off > RATE_WARN_SHARE, off > RATE_FAIL_SHARE)
    share = lost / (lost + stream.times_s.size)
    loss = worst_of(lost + stream.damaged > 0, share > LOSS_FAIL_SHARE)
    lateness_s = stream.arrivals_s - stream.times_s
    spread_s = float(np.percentile(lateness_s, 99) - lateness_s.min())
    late = worst_of(spread_s > jitter.warn_s, spread_s > jitter.fail_s)
    return [
        Check(
            verdict=rate,
            what=f"{name}: {rate_Hz:.2f} Hz of {stream.expected_Hz:g} Hz",
            cure="" if rate == "pass" else "is its supply weak, or is it set to another rate?",
        ),
        Check(
            verdict=loss,
            what=f"{name}: {lost} of {lost + stream.times_s.size} lost, {stream.damaged} damaged",
            cure="" if loss == "pass" else CABLE,
        ),
        Check(
            verdict=late,
            what=f"{name}: jitter {1e3 * spread_s:.1f} ms (99 %)",
            cure=""
            if late == "pass"
            else "this computer is busy: close programs, or use one with more cores",
        ),
    ]


def judge_battery(battery_V: float) -> Check:
    """Judge the voltage at rest."""
    what = f"battery {battery_V:.2f} V"
    if battery_V < 1.0:
        return Check(verdict="fail", what=what, cure="no battery is measured: connect it, check its divider")
    if battery_V < BATTERY_ARM_V:
        return Check(
            verdict="fail", what=what, cure="charge it: the board stops at 6.4 V, then waits for 7.0 V"
        )
    if battery_V < BATTERY_WARN_V:
        return Check(verdict="warn", what=what, cure="charge it soon: the board stops at 6.4 V under load")
    return Check(verdict="pass", what=what)


def judge_spin(side: str, own: int, other: int, lost_edges: int) -> Check:
    """Judge the counts of both encoders after the motor of `side` alone was driven forward."""
    opposite = "right" if side == "left" else "left"
    what = f"{side} motor forward: {side} encoder {own:+d}, {opposite} encoder {other:+d} counts"
    if lost_edges > SURE_COUNTS:
        cure = f"edges are lost: one wire of the {side} encoder is loose or noisy"
        return Check(verdict="fail", what=f"{what}, {lost_edges} edges lost", cure=cure)
    if abs(own) < SURE_COUNTS and abs(other) < SURE_COUNTS:
        cure = (
            f"dead: if the {side} wheel turned, its encoder has no supply or a cut wire; "
            "if it stood, its motor is not connected or blocked"
        )
        return Check(verdict="fail", what=what, cure=cure)
    if abs(other) > OTHER_SHARE * abs(own):
        cure = "swapped: exchange the plugs of the left and the right encoder (or of the motors)"
        return Check(verdict="fail", what=what, cure=cure)
    if own < 0:
        cure = (
            f"wrong direction: if the {side} wheel turned forward, exchange wires A and B of its encoder; "
            "if backward, exchange the two wires of its motor"
        )
        return Check(verdict="fail", what=what, cure=cure)
    return Check(verdict="pass", what=what)
