"""Convert measurements to verdicts. Pure: no port, no clock."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.doctor.check import Check, worst_of

CABLE = "try another cable and USB port, keep motor wires away from it, close other programs"
SLOW = "a network, a hub or a busy computer delays the data; connect the device directly"

REQUESTS = 50
REPLY_TIMEOUT_S = 1.0  # far above the failure limit, so that a slow link is measured and not counted as lost
MAX_LOST_IN_A_ROW = 5

BOARD_ROUND_TRIP_WARN_S, BOARD_ROUND_TRIP_FAIL_S = 0.04, 0.15  # fail: half the board's own time-out
# Warn: one revolution. Fail: the reply time-out of the driver.
LIDAR_ROUND_TRIP_WARN_S, LIDAR_ROUND_TRIP_FAIL_S = 0.1, 0.3
RATE_WARN_SHARE, RATE_FAIL_SHARE = 0.03, 0.1
LOSS_FAIL_SHARE = 0.02
BOARD_JITTER_WARN_S, BOARD_JITTER_FAIL_S = 0.02, 0.15
LIDAR_JITTER_WARN_S, LIDAR_JITTER_FAIL_S = 0.02, 0.1
CELL_MARGIN_V, CELL_HIGH_V = 0.1, 4.5  # above battery_rearm; the board refuses a higher one
MIN_COUNTS = 20
OTHER_SHARE = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Stream:
    """Messages that were recorded from a link."""

    times_s: FloatArray  # stamp of each message, on the host's clock, shape (n,)
    arrivals_s: FloatArray  # when each message arrived, shape (n,)
    expected_Hz: float
    damaged: int  # frames that failed the CRC, both directions


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Jitter limits [s]."""

    warn_s: float
    fail_s: float


def measure_round_trips(request: Callable[[int, float], float | None]) -> tuple[list[float], int]:
    """Send REQUESTS requests, fewer if none is answered; return the round trips [s] and how many were lost.

    `request(number, timeout_s)` returns the time [s] from request to reply, or None without a reply.
    """
    trips_s: list[float] = []
    lost = in_a_row = 0
    for number in range(REQUESTS):
        trip_s = request(number, REPLY_TIMEOUT_S)
        if trip_s is not None:
            trips_s.append(trip_s)
            in_a_row = 0
            continue
        lost, in_a_row = lost + 1, in_a_row + 1
        if in_a_row == MAX_LOST_IN_A_ROW:
            break
    return trips_s, lost


def judge_round_trip(name: str, trips_s: list[float], lost: int, warn_s: float, fail_s: float) -> Check:
    """Judge the round trips and the lost requests."""
    if not trips_s:
        return Check(verdict="fail", what=f"{name}: no request was answered", fix=CABLE)
    sent = len(trips_s) + lost
    median_ms, max_ms = 1e3 * float(np.median(trips_s)), 1e3 * max(trips_s)
    delay = worst_of(max_ms > 1e3 * warn_s, median_ms > 1e3 * fail_s)
    loss = worst_of(lost > 0, lost / sent > LOSS_FAIL_SHARE)
    verdict = worst_of(delay != "pass" or loss != "pass", "fail" in {delay, loss})
    what = f"{name}: round trip {median_ms:.1f} ms, at most {max_ms:.1f} ms, "
    what += f"jitter {1e3 * float(np.std(trips_s)):.1f} ms; {lost} of {sent} requests without reply"
    return Check(verdict=verdict, what=what, fix=CABLE if loss != "pass" else SLOW if delay != "pass" else "")


def judge_stream(name: str, stream: Stream, limits: Limits) -> list[Check]:
    """Judge rate, loss and jitter of a stream."""
    if stream.times_s.size < 3:
        return [Check(verdict="fail", what=f"{name}: no data", fix=CABLE)]
    period_s = 1.0 / stream.expected_Hz
    steps = np.maximum(np.rint(np.diff(stream.times_s) / period_s), 1.0)
    lost = int(steps.sum()) - steps.size
    rate_Hz = float(steps.sum() / (stream.times_s[-1] - stream.times_s[0]))
    error = abs(rate_Hz / stream.expected_Hz - 1.0)
    rate = worst_of(error > RATE_WARN_SHARE, error > RATE_FAIL_SHARE)
    share = lost / (lost + stream.times_s.size)
    loss = worst_of(lost + stream.damaged > 0, share > LOSS_FAIL_SHARE)
    lateness_s = stream.arrivals_s - stream.times_s
    jitter_s = float(np.percentile(lateness_s, 99) - lateness_s.min())
    late = worst_of(jitter_s > limits.warn_s, jitter_s > limits.fail_s)
    return [
        Check(
            verdict=rate,
            what=f"{name}: {rate_Hz:.2f} Hz of {stream.expected_Hz:g} Hz",
            fix="" if rate == "pass" else "is its supply weak, or is it set to another rate?",
        ),
        Check(
            verdict=loss,
            what=f"{name}: {lost} of {lost + stream.times_s.size} lost, {stream.damaged} damaged",
            fix="" if loss == "pass" else CABLE,
        ),
        Check(
            verdict=late,
            what=f"{name}: jitter {1e3 * jitter_s:.1f} ms (99 %)",
            fix="" if late == "pass" else "this computer is busy: close programs, or use one with more cores",
        ),
    ]


def judge_battery(battery_V: float, *, cells: int, stop_V: float, rearm_V: float) -> Check:
    """Judge the voltage at standstill by the board's cells and its thresholds of the whole battery."""
    what = f"battery {battery_V:.2f} V"
    if battery_V < 1.0:
        return Check(
            verdict="fail", what=what, fix="no battery voltage: connect the battery, check its divider"
        )
    if battery_V > CELL_HIGH_V * cells:
        fix = f"too high for {cells} cells: set battery_cells on the board, or check its wiring"
        return Check(verdict="fail", what=what, fix=fix)
    if battery_V < rearm_V:
        fix = f"charge it: the board stops at {stop_V:.1f} V, then waits for {rearm_V:.1f} V"
        return Check(verdict="fail", what=what, fix=fix)
    if battery_V < rearm_V + CELL_MARGIN_V * cells:
        fix = f"charge it soon: the board stops at {stop_V:.1f} V under load"
        return Check(verdict="warn", what=what, fix=fix)
    return Check(verdict="pass", what=what)


def judge_spin(side: str, own: int, other: int, lost_edges: int) -> Check:
    """Judge the counts of both encoders after only the motor of `side` was driven forward."""
    opposite = "right" if side == "left" else "left"
    what = f"{side} motor forward: {side} encoder {own:+d}, {opposite} encoder {other:+d} counts"
    if lost_edges > MIN_COUNTS:
        fix = f"edges are lost: one wire of the {side} encoder is loose or noisy"
        return Check(verdict="fail", what=f"{what}, {lost_edges} edges lost", fix=fix)
    if abs(own) < MIN_COUNTS and abs(other) < MIN_COUNTS:
        fix = (
            f"dead: if the {side} wheel turned, its encoder has no supply or a cut wire; "
            "if it did not turn, its motor is not connected or blocked"
        )
        return Check(verdict="fail", what=what, fix=fix)
    if abs(other) > OTHER_SHARE * abs(own):
        fix = "swapped: exchange the plugs of the left and the right encoder (or of the motors)"
        return Check(verdict="fail", what=what, fix=fix)
    if own < 0:
        fix = (
            f"wrong direction: if the {side} wheel turned forward, exchange wires A and B of its encoder; "
            "if backward, exchange the two wires of its motor"
        )
        return Check(verdict="fail", what=what, fix=fix)
    return Check(verdict="pass", what=what)
