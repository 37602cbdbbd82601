"""Compare the wheels, as estimated while driving, with the model that the board's gains were designed for."""

from dataclasses import dataclass

from thumper.odometry.drive_train import (
    DriveTrainEstimate,
    DriveTrainEstimator,
    Estimate,
    WheelEstimate,
    WheelTick,
)

PERIOD_TICKS = 50  # between two comparisons
MAX_RESTARTS = 3
SIGMAS = 4.0
FRICTION_SHARE, LEAST_FRICTION_PWM = 0.3, 6.0
GAIN_SHARE, TIME_CONSTANT_SHARE = 0.1, 0.3
TUNE = "run `thumper tune`"


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardWheelModel:
    """The board's model of a wheel: `ks` [PWM], `kv` [PWM/(rad/s)] and `ka` [PWM/(rad/s^2)]."""

    ks: float
    kv: float
    ka: float


class DriveTrainMonitor:
    """Estimates the wheels, and says how they differ from the board's model and from each other.

    Never raises: an estimate that fails starts again, `MAX_RESTARTS` times, and says so.
    """

    def __init__(
        self, *, counts_per_rev: float, pwm_frequency_Hz: float, feed_forward: BoardWheelModel | None = None
    ) -> None:
        self._counts_per_rev, self._delay_s = counts_per_rev, 0.5 / pwm_frequency_Hz
        self.feed_forward = feed_forward
        self.failure = ""  # what failed, and whether the estimate goes on
        self._failures = 0
        self._start()

    def _start(self) -> None:
        self._estimator = DriveTrainEstimator(counts_per_rev=self._counts_per_rev, delay_s=self._delay_s)
        self.estimate: DriveTrainEstimate | None = None
        self._ticks = 0

    def add(self, tick: WheelTick) -> None:
        """Add the next tick."""
        if self._failures > MAX_RESTARTS:
            return
        try:
            self._estimator.add(tick)
            self._ticks += 1
            if self._ticks % PERIOD_TICKS == 0:
                self.estimate = self._estimator.estimate()
        except Exception as error:  # whatever fails here, the robot must go on
            self._start()
            self._failures += 1
            goes_on = (
                "it starts again" if self._failures <= MAX_RESTARTS else "it stopped until the next start"
            )
            self.failure = (
                f"the estimate of the wheels failed {self._failures} times: {goes_on} "
                f"({type(error).__name__}: {error}); please report it"
            )

    def warnings(self) -> dict[str, str]:
        """Return one line per kind: how the wheels differ from the board's model, and what failed."""
        found = {}
        if self.failure:
            found["WHEELS_STOPPED" if self._failures > MAX_RESTARTS else "WHEELS_FAILED"] = self.failure
        model, estimate = self.feed_forward, self.estimate
        if estimate is None or model is None or model.kv <= 0.0:
            return found
        drags, is_weak = dragging_side(estimate.drag_difference, model), weaker_side(estimate.gain_ratio)
        sides = [line for line in (drags, is_weak) if line]
        if sides:
            found["WHEELS_SIDE"] = f"{'; '.join(sides)}; check its wheels and motors, then {TUNE}"
        parts = drifts(estimate.mean, model, of_one_side=bool(sides))
        if parts:
            found["WHEELS"] = f"{'; '.join(parts)}; check the wheels and the battery, then {TUNE}"
        return found


def dragging_side(difference: Estimate | None, model: BoardWheelModel) -> str:
    """Return which side has more friction than the other, beyond noise and usual spread; else nothing."""
    if difference is None or abs(difference.value) <= _friction_limit_pwm(difference, model):
        return ""
    side, other = ("left", "right") if difference.value > 0.0 else ("right", "left")
    return (
        f"the {side} side needs {abs(difference.value):.0f} PWM more against friction than the {other}: "
        f"a wheel drags on the {side}"
    )


def weaker_side(ratio: Estimate | None) -> str:
    """Return which side turns slower at the same PWM, beyond noise and usual spread; else nothing.

    `ratio`: of the gains, left to right.
    """
    if ratio is None:
        return ""
    weaker = 1.0 - min(ratio.value, 1.0 / ratio.value)
    if weaker <= max(SIGMAS * ratio.std / ratio.value, GAIN_SHARE):
        return ""
    side, other = ("left", "right") if ratio.value < 1.0 else ("right", "left")
    return (
        f"the {side} side turns {100 * weaker:.0f} % slower than the {other} at the same PWM: "
        "its bridge, cables or motors are weak"
    )


def _friction_limit_pwm(friction: Estimate, model: BoardWheelModel) -> float:
    return max(SIGMAS * friction.std, FRICTION_SHARE * model.ks, LEAST_FRICTION_PWM)


def drifts(wheels: WheelEstimate, model: BoardWheelModel, *, of_one_side: bool = False) -> list[str]:
    """Return how the wheels differ from the model by more than noise and usual spread, one text each.

    Unless one side stands out, the cause acts on both: the floor, the load or the battery.
    """
    found = []
    friction = wheels.friction
    if friction is not None and abs(friction.value - model.ks) > _friction_limit_pwm(friction, model):
        more = "one side more than the other" if of_one_side else "both sides drag, or carpet or a load does"
        cause = more if friction.value > model.ks else "they run easier"
        found.append(
            f"the wheels need {friction.value:.0f} PWM against friction, ks is {model.ks:.0f}: {cause}"
        )
    if (gain := wheels.gain) is not None:
        ratio, std = gain.value * model.kv, gain.std * model.kv
        if abs(ratio - 1.0) > max(SIGMAS * std, GAIN_SHARE):
            word = "faster" if ratio > 1.0 else "slower"
            cause = "" if ratio > 1.0 or of_one_side else ": a weak battery, or a dead motor"
            found.append(f"they turn {100 * abs(ratio - 1.0):.0f} % {word} than kv says{cause}")
    if (lag := wheels.time_constant_s) is not None and model.ka > 0.0:
        model_s = model.ka / model.kv
        if abs(lag.value - model_s) > max(SIGMAS * lag.std, TIME_CONSTANT_SHARE * model_s):
            found.append(
                f"their time constant is {1e3 * lag.value:.0f} ms, by ka and kv {1e3 * model_s:.0f} ms: "
                "the load or the number of working motors changed"
            )
    return found
